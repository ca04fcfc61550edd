// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/storage/postgres/database.hpp"

#include <algorithm>
#include <map>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <pqxx/pqxx>

#include "cairn/core/error.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/core/text.hpp"

namespace cairn::postgres {

namespace {

using storage::ColumnType;

class PostgresConnection : public storage::detail::Connection {
 public:
  PostgresConnection(const std::string& url, std::string its_name, const OpenOptions& options);

  const OpenOptions& options() const { return options_; }
  // Runs `how` in the open transaction, or else in one of its own.
  template <class Run>
  pqxx::result run(const Run& how);

  std::unique_ptr<storage::detail::Cursor> prepare(std::string_view sql) override;
  void execute(const std::string& sql) override;
  std::int64_t changes() const noexcept override { return changes_; }
  bool in_transaction() const noexcept override { return open_ != nullptr; }
  void begin(Transaction::Kind kind) override;
  void commit() override;
  void roll_back() noexcept override { open_.reset(); }

 private:
  void wait_to_write();

  OpenOptions options_;
  std::unique_ptr<pqxx::connection> handle_;
  std::unique_ptr<pqxx::transaction_base> open_;  // null outside of transactions
  std::int64_t changes_ = 0;
};

// PostgreSQL's numbers of its types.
constexpr unsigned kBytea = 17;
constexpr unsigned kInt8 = 20;
constexpr unsigned kInt4 = 23;
constexpr unsigned kText = 25;
constexpr unsigned kFloat8 = 701;

// What writers wait for in turn: a number that no other program is likely to lock in this database.
constexpr std::int64_t kWriters = 0x434149524e415400;

// Between two looks at whether to stop waiting.
constexpr std::chrono::milliseconds kWaitAtATime{250};

std::string first_line(std::string_view text) {
  std::string line(text.substr(0, text.find('\n')));
  for (const std::string_view prefix : {"ERROR:  ", "FATAL:  "}) {
    if (line.starts_with(prefix)) line.erase(0, prefix.size());
  }
  return plain_text(line);
}

[[noreturn]] void fail(const PostgresConnection& connection, const pqxx::sql_error& error) {
  const std::string& name = connection.name;
  const std::string& code = error.sqlstate();
  const auto is = [&](std::string_view one) { return code == one; };
  if (is("22021")) throw Error(ErrorKind::kMisuse, name, "text that is not UTF-8", "UTF-8");
  if (is("53100")) {
    throw Error(ErrorKind::kStorage, name, "no space is left for it", "a disk with space");
  }
  if (is("25006") || is("42501")) {
    throw Error(ErrorKind::kStorage, name, "cannot be written: " + first_line(error.what()),
                "permission to write");
  }
  // The server also ends a statement for its own limit of time, or for its administrator.
  if (is("57014") && connection.options().stop.stop_requested()) {
    throw Error(ErrorKind::kCancelled, name, "stopped as asked", "");
  }
  throw Error(ErrorKind::kStorage, name, first_line(error.what()), "");
}

// Calls libpqxx, whose errors become ours.
template <class Action>
auto guarded(const PostgresConnection& connection, const Action& action) {
  const std::string& name = connection.name;
  try {
    return action();
  } catch (const pqxx::in_doubt_error&) {
    throw Error(
        ErrorKind::kStorage, name,
        "the connection was lost while a change was being kept; whether it was is not known",
        "to look: 'cairn atlas log' lists what was kept");
  } catch (const pqxx::broken_connection& error) {
    throw Error(ErrorKind::kStorage, name, "no connection: " + first_line(error.what()),
                "a PostgreSQL server that can be reached");
  } catch (const pqxx::sql_error& error) {
    fail(connection, error);
  } catch (const pqxx::failure& error) {
    throw Error(ErrorKind::kStorage, name, first_line(error.what()), "");
  }
}

// Where libpq takes the user and the password of a URL to end: at the @, or else at the host.
std::size_t end_of_user(std::string_view url) {
  const std::size_t begin = std::min(url.find("://") + 3, url.size());
  const std::size_t end = url.find_first_of("@/", begin);
  return end != std::string_view::npos && url[end] == '@' ? end : begin;
}

// Whether a message about a failed connection cannot quote a part of a password: neither because libpq could not read
// the URL, nor because it took a part of a password that is not escaped for a host or a port.
bool can_be_told(std::string_view message, std::string_view url) {
  const std::size_t at = url.rfind('@');
  // It holds none.
  if (at == std::string_view::npos && url.find("password=") == std::string_view::npos) return true;
  if (at != std::string_view::npos && at > end_of_user(url)) return false;
  return message.starts_with("connection to server") ||
         message.starts_with("could not connect to server") ||
         message.starts_with("could not translate host name") || message.starts_with("FATAL");
}

template <class Run>
pqxx::result PostgresConnection::run(const Run& how) {
  return guarded(*this, [&] {
    pqxx::result result;
    if (open_ != nullptr) {
      result = how(*open_);
    } else {
      pqxx::nontransaction alone(*handle_);
      result = how(alone);
    }
    changes_ = static_cast<std::int64_t>(result.affected_rows());
    return result;
  });
}

class PostgresCursor : public storage::detail::Cursor {
 public:
  PostgresCursor(PostgresConnection& connection, std::string_view sql)
      : connection_(connection), sql_(sql) {
    std::replace(sql_.begin(), sql_.end(), '?', '$');
  }

  void bind(int parameter, std::int64_t value) override {
    put(parameter, fmt::format("{}", value));
  }
  void bind(int parameter, double value) override {
    put(parameter, fmt::format("{}", value));  // the shortest text that gives it back
  }
  void bind(int parameter, std::string_view text) override {
    if (text.find('\0') != std::string_view::npos) {
      throw Error(ErrorKind::kMisuse, connection_.name,
                  fmt::format("text with a NUL in it: {}", printable(text)), "text without");
    }
    put(parameter, std::string(text));
  }
  void bind(int parameter, std::span<const std::byte> blob) override {
    constexpr std::string_view kDigits = "0123456789abcdef";
    std::string text = "\\x";
    text.reserve(2 + 2 * blob.size());
    for (const std::byte byte : blob) {
      text += kDigits[std::to_integer<std::size_t>(byte >> 4)];
      text += kDigits[std::to_integer<std::size_t>(byte & std::byte{15})];
    }
    put(parameter, std::move(text));
  }
  void bind(int parameter, std::nullptr_t) override { put(parameter, std::nullopt); }

  bool step() override {
    blobs_.clear();
    if (rows_) {
      ++row_;
    } else {
      std::vector<const char*> parameters;
      for (const auto& value : parameters_) parameters.push_back(value ? value->c_str() : nullptr);
      rows_ = connection_.run([&](pqxx::transaction_base& transaction) {
        return transaction.exec_params(sql_, pqxx::prepare::make_dynamic_params(parameters));
      });
      row_ = 0;
    }
    if (row_ < rows_->size()) return true;
    rows_.reset();
    return false;
  }

  void reset() override {
    rows_.reset();
    parameters_.clear();
  }

  const std::string& database() const override { return connection_.name; }
  std::string column_name(int column) const override { return field(column).name(); }

  ColumnType type(int column) const override {
    const pqxx::field one = field(column);
    if (one.is_null()) return ColumnType::kNull;
    switch (one.type()) {
      case kInt8:
      case kInt4:
        return ColumnType::kInteger;
      case kFloat8:
        return ColumnType::kReal;
      case kText:
        return ColumnType::kText;
      case kBytea:
        return ColumnType::kBlob;
      default:
        return ColumnType::kOther;
    }
  }

  std::int64_t integer(int column) const override { return field(column).as<std::int64_t>(); }

  double real(int column) const override {
    const auto number = parse_number(text(column));
    if (!number) {
      throw Error(ErrorKind::kInput, connection_.name, fmt::format("column {}", column),
                  "a finite number");
    }
    return *number;
  }

  std::string_view text(int column) const override {
    const pqxx::field one = field(column);
    return {one.c_str(), one.size()};
  }

  std::span<const std::byte> blob(int column) const override {
    const auto [found, added] = blobs_.try_emplace(column, pqxx::binarystring(field(column)));
    return std::as_bytes(std::span(found->second.data(), found->second.size()));
  }

 private:
  void put(int parameter, std::optional<std::string> value) {
    const auto index = static_cast<std::size_t>(parameter - 1);
    if (parameters_.size() <= index) parameters_.resize(index + 1);
    parameters_[index] = std::move(value);
  }

  pqxx::field field(int column) const { return (*rows_)[row_][column]; }

  PostgresConnection& connection_;
  std::string sql_;
  std::vector<std::optional<std::string>> parameters_;
  std::optional<pqxx::result> rows_;  // none before the first step()
  pqxx::result::size_type row_ = 0;
  mutable std::map<int, pqxx::binarystring> blobs_;  // of the current row, as far as they were read
};

PostgresConnection::PostgresConnection(const std::string& url, std::string its_name,
                                       const OpenOptions& options)
    : Connection(std::move(its_name)), options_(options) {
  // What the URL says itself comes later, and counts.
  const std::size_t query = std::min(url.find('?', end_of_user(url)), url.size());
  const std::string own =
      query + 1 < url.size() ? fmt::format("&{}", url.substr(query + 1)) : std::string();
  const std::string full = fmt::format("{}?connect_timeout=10&fallback_application_name=cairn{}",
                                       url.substr(0, query), own);
  try {
    handle_ = std::make_unique<pqxx::connection>(full);
  } catch (const pqxx::failure& error) {
    const bool told = can_be_told(error.what(), url);
    throw Error(ErrorKind::kStorage, name,
                told ? "no connection: " + first_line(error.what()) : "no connection",
                told ? "a PostgreSQL server that can be reached"
                     : "a server at postgresql://USER:PASSWORD@HOST:PORT/DATABASE, with / ? @ % in "
                       "these as %2F %3F %40 %25");
  }
  // A server may be told to acknowledge what is not on its disk yet.
  execute("SET synchronous_commit TO on");
  execute("SET client_encoding TO 'UTF8'");
  execute("SET extra_float_digits TO 1");
  execute("SET bytea_output TO hex");
  execute("SET client_min_messages TO warning");
  if (options.read_only) execute("SET default_transaction_read_only TO on");
  if (!options.schema.empty()) {
    execute(fmt::format("SET search_path TO {}",
                        guarded(*this, [&] { return handle_->quote_name(options.schema); })));
  }
}

std::unique_ptr<storage::detail::Cursor> PostgresConnection::prepare(std::string_view sql) {
  return std::make_unique<PostgresCursor>(*this, sql);
}

void PostgresConnection::execute(const std::string& sql) {
  run([&](pqxx::transaction_base& transaction) { return transaction.exec(sql); });
}

void PostgresConnection::begin(Transaction::Kind kind) {
  refuse_if(open_ != nullptr, name, "a transaction within another", "one at a time");
  if (kind == Transaction::Kind::kWrite) return wait_to_write();
  guarded(*this, [&] {
    if (kind == Transaction::Kind::kRead) {
      open_ = std::make_unique<
          pqxx::transaction<pqxx::repeatable_read, pqxx::readwrite_policy::read_only>>(*handle_);
    } else {
      open_ = std::make_unique<pqxx::work>(*handle_);
    }
  });
}

void PostgresConnection::wait_to_write() {
  const auto deadline = std::chrono::steady_clock::now() + options_.lock_timeout;
  for (;;) {
    const bool locked = guarded(*this, [&] {
      open_ = std::make_unique<pqxx::work>(*handle_);
      try {
        open_->exec(fmt::format("SET LOCAL lock_timeout TO {}", kWaitAtATime.count()));
        open_->exec(fmt::format("SELECT pg_advisory_xact_lock({})", kWriters));
        return true;
      } catch (const pqxx::sql_error& error) {
        open_.reset();
        if (error.sqlstate() != "55P03") throw;  // any other than that the lock was not available
        return false;
      } catch (...) {
        open_.reset();
        throw;
      }
    });
    if (locked) return;
    if (options_.stop.stop_requested()) {
      throw Error(ErrorKind::kCancelled, name, "stopped as asked", "");
    }
    if (std::chrono::steady_clock::now() >= deadline) {
      throw Error(ErrorKind::kStorage, name,
                  "in use by another process, which did not finish in time",
                  "to be tried again later");
    }
  }
}

void PostgresConnection::commit() {
  guarded(*this, [&] {
    // Whatever comes of it, it is over.
    const std::unique_ptr<pqxx::transaction_base> open = std::move(open_);
    open->commit();
  });
}

}  // namespace

Database::Database(const std::string& url, std::string name, const OpenOptions& options)
    : storage::Database(std::make_unique<PostgresConnection>(url, std::move(name), options)) {}

}  // namespace cairn::postgres
