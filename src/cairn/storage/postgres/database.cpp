// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/storage/postgres/database.hpp"

#include <algorithm>
#include <map>
#include <utility>

#include <fmt/format.h>
#include <pqxx/pqxx>

#include "cairn/core/error.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/core/plain_text.hpp"

namespace cairn::postgres {

struct detail::Connection {
  std::string name;
  OpenOptions options;
  std::unique_ptr<pqxx::connection> handle;
  std::unique_ptr<pqxx::transaction_base> open;  ///< null outside of transactions
  std::int64_t changes = 0;

  template <class Run>
  pqxx::result run(const Run& how);
};

namespace {

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

[[noreturn]] void fail(const detail::Connection& connection, const pqxx::sql_error& error) {
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
  if (is("57014") && connection.options.stop.stop_requested()) {
    throw Error(ErrorKind::kCancelled, name, "stopped as asked", "");
  }
  throw Error(ErrorKind::kStorage, name, first_line(error.what()), "");
}

// Calls libpqxx, whose errors become ours.
template <class Action>
auto guarded(const detail::Connection& connection, const Action& action) {
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

}  // namespace

template <class Run>
pqxx::result detail::Connection::run(const Run& how) {
  return guarded(*this, [&] {
    pqxx::result result;
    if (open != nullptr) {
      result = how(*open);
    } else {
      pqxx::nontransaction alone(*handle);
      result = how(alone);
    }
    changes = static_cast<std::int64_t>(result.affected_rows());
    return result;
  });
}

struct detail::Rows {
  pqxx::result result;
  pqxx::result::size_type at = 0;
  mutable std::map<int, pqxx::binarystring>
      blobs;  ///< of the current row, as far as they were read
};

Statement::Statement(detail::Connection& connection, std::string_view sql)
    : connection_(&connection), sql_(sql) {
  std::replace(sql_.begin(), sql_.end(), '?', '$');
}

Statement::Statement(Statement&&) noexcept = default;
Statement& Statement::operator=(Statement&&) noexcept = default;
Statement::~Statement() = default;

namespace {

void put(std::vector<std::optional<std::string>>& parameters, int parameter,
         std::optional<std::string> value) {
  const auto index = static_cast<std::size_t>(parameter - 1);
  if (parameters.size() <= index) parameters.resize(index + 1);
  parameters[index] = std::move(value);
}

}  // namespace

Statement& Statement::bind(int parameter, std::int64_t value) {
  put(parameters_, parameter, fmt::format("{}", value));
  return *this;
}

Statement& Statement::bind(int parameter, double value) {
  put(parameters_, parameter, fmt::format("{}", value));  // the shortest text that gives it back
  return *this;
}

Statement& Statement::bind(int parameter, std::string_view text) {
  if (text.find('\0') != std::string_view::npos) {
    throw Error(ErrorKind::kMisuse, connection_->name,
                fmt::format("text with a NUL in it: {}", printable(text)), "text without");
  }
  put(parameters_, parameter, std::string(text));
  return *this;
}

Statement& Statement::bind(int parameter, std::span<const std::byte> blob) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string text = "\\x";
  text.reserve(2 + 2 * blob.size());
  for (const std::byte byte : blob) {
    text += kDigits[std::to_integer<std::size_t>(byte >> 4)];
    text += kDigits[std::to_integer<std::size_t>(byte & std::byte{15})];
  }
  put(parameters_, parameter, std::move(text));
  return *this;
}

Statement& Statement::bind(int parameter, std::nullptr_t) {
  put(parameters_, parameter, std::nullopt);
  return *this;
}

bool Statement::step() {
  if (rows_ == nullptr) {
    std::vector<const char*> parameters;
    for (const auto& value : parameters_) {
      parameters.push_back(value ? value->c_str() : nullptr);
    }
    rows_ = std::make_unique<detail::Rows>();
    try {
      rows_->result = connection_->run([&](pqxx::transaction_base& transaction) {
        return transaction.exec_params(sql_, pqxx::prepare::make_dynamic_params(parameters));
      });
    } catch (...) {
      rows_.reset();
      throw;
    }
  } else {
    ++rows_->at;
    rows_->blobs.clear();
  }
  if (rows_->at < rows_->result.size()) return true;
  rows_.reset();
  return false;
}

void Statement::reset() {
  rows_.reset();
  parameters_.clear();
}

bool Statement::is_null(int column) const {
  return rows_->result[rows_->at][column].is_null();
}

std::string_view Statement::value(int column, unsigned type, std::string_view expected) const {
  const pqxx::field field = rows_->result[rows_->at][column];
  const unsigned is = field.type();
  const bool fits = is == type || (type == kInt8 && is == kInt4);
  if (field.is_null() || !fits) {
    throw Error(ErrorKind::kInput, connection_->name,
                fmt::format("column {}: {}", printable(field.name()),
                            field.is_null() ? "NULL" : fmt::format("a value of type {}", is)),
                std::string(expected));
  }
  return {field.c_str(), field.size()};
}

std::int64_t Statement::integer(int column) const {
  const std::string_view digits = value(column, kInt8, "an integer");
  std::int64_t number = 0;
  std::from_chars(digits.data(), digits.data() + digits.size(), number);
  return number;
}

std::uint64_t Statement::unsigned_integer(int column) const {
  const std::int64_t number = integer(column);
  if (number < 0) {
    throw Error(ErrorKind::kInput, connection_->name, fmt::format("column {}: {}", column, number),
                "an integer of at least 0");
  }
  return static_cast<std::uint64_t>(number);
}

double Statement::real(int column) const {
  const auto number = parse_number(value(column, kFloat8, "a number"));
  if (!number) {
    throw Error(ErrorKind::kInput, connection_->name, fmt::format("column {}", column),
                "a finite number");
  }
  return *number;
}

std::string_view Statement::text(int column) const {
  return value(column, kText, "text");
}

std::span<const std::byte> Statement::blob(int column) const {
  value(column, kBytea, "bytes");
  const auto [found, added] =
      rows_->blobs.try_emplace(column, pqxx::binarystring(rows_->result[rows_->at][column]));
  return std::as_bytes(std::span(found->second.data(), found->second.size()));
}

std::optional<double> Statement::optional_real(int column) const {
  return is_null(column) ? std::nullopt : std::optional(real(column));
}

std::optional<std::span<const std::byte>> Statement::optional_blob(int column) const {
  return is_null(column) ? std::nullopt : std::optional(blob(column));
}

Database::Database(const std::string& url, std::string name, const OpenOptions& options)
    : connection_(std::make_unique<detail::Connection>()) {
  connection_->name = std::move(name);
  connection_->options = options;
  // What the URL says itself comes later, and counts.
  const std::size_t query = std::min(url.find('?', end_of_user(url)), url.size());
  const std::string own =
      query + 1 < url.size() ? fmt::format("&{}", url.substr(query + 1)) : std::string();
  const std::string full = fmt::format("{}?connect_timeout=10&fallback_application_name=cairn{}",
                                       url.substr(0, query), own);
  try {
    connection_->handle = std::make_unique<pqxx::connection>(full);
  } catch (const pqxx::failure& error) {
    const bool told = can_be_told(error.what(), url);
    throw Error(ErrorKind::kStorage, connection_->name,
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
    execute(fmt::format("SET search_path TO {}", guarded(*connection_, [&] {
                          return connection_->handle->quote_name(options.schema);
                        })));
  }
}

Database::Database(Database&&) noexcept = default;
Database& Database::operator=(Database&&) noexcept = default;
Database::~Database() = default;

const std::string& Database::name() const noexcept {
  return connection_->name;
}

Statement Database::prepare(std::string_view sql) {
  return {*connection_, sql};
}

void Database::execute(const std::string& sql) {
  connection_->run([&](pqxx::transaction_base& transaction) { return transaction.exec(sql); });
}

std::int64_t Database::integer(std::string_view sql) {
  Statement statement = prepare(sql);
  if (!statement.step()) throw Error(ErrorKind::kInput, name(), "no rows", "an integer");
  return statement.integer(0);
}

std::string Database::text(std::string_view sql) {
  Statement statement = prepare(sql);
  if (!statement.step()) throw Error(ErrorKind::kInput, name(), "no rows", "text");
  return std::string(statement.text(0));
}

std::int64_t Database::changes() const noexcept {
  return connection_->changes;
}

bool Database::in_transaction() const noexcept {
  return connection_->open != nullptr;
}

Transaction::Transaction(Database& database, Kind kind) : connection_(database.connection_.get()) {
  detail::Connection& connection = *connection_;
  if (connection.open != nullptr) {
    throw Error(ErrorKind::kMisuse, connection.name, "a transaction within another",
                "one at a time");
  }
  pqxx::connection& handle = *connection.handle;
  if (kind != Kind::kWrite) {
    guarded(connection, [&] {
      if (kind == Kind::kRead) {
        connection.open = std::make_unique<
            pqxx::transaction<pqxx::repeatable_read, pqxx::readwrite_policy::read_only>>(handle);
      } else {
        connection.open = std::make_unique<pqxx::work>(handle);
      }
    });
    return;
  }
  const auto deadline = std::chrono::steady_clock::now() + connection.options.lock_timeout;
  for (;;) {
    const bool locked = guarded(connection, [&] {
      connection.open = std::make_unique<pqxx::work>(handle);
      try {
        connection.open->exec(fmt::format("SET LOCAL lock_timeout TO {}", kWaitAtATime.count()));
        connection.open->exec(fmt::format("SELECT pg_advisory_xact_lock({})", kWriters));
        return true;
      } catch (const pqxx::sql_error& error) {
        connection.open.reset();
        if (error.sqlstate() != "55P03") throw;  // any other than that the lock was not available
        return false;
      } catch (...) {
        connection.open.reset();
        throw;
      }
    });
    if (locked) return;
    if (connection.options.stop.stop_requested()) {
      throw Error(ErrorKind::kCancelled, connection.name, "stopped as asked", "");
    }
    if (std::chrono::steady_clock::now() >= deadline) {
      throw Error(ErrorKind::kStorage, connection.name,
                  "in use by another process, which did not finish in time",
                  "to be tried again later");
    }
  }
}

Transaction::~Transaction() {
  connection_->open.reset();
}

void Transaction::commit() {
  guarded(*connection_, [&] {
    // Whatever comes of it, it is over.
    const std::unique_ptr<pqxx::transaction_base> open = std::move(connection_->open);
    open->commit();
  });
}

}  // namespace cairn::postgres
