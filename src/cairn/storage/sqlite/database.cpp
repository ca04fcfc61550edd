// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/storage/sqlite/database.hpp"

#include <algorithm>
#include <cstring>
#include <limits>

#include <fmt/format.h>
#include <sqlite3.h>

#include "cairn/core/error.hpp"

namespace cairn::sqlite {
namespace {

namespace fs = std::filesystem;

// Most bytes of a text or blob, and of a row.
constexpr std::uint64_t kLongestValue = 1'000'000'000;

// Virtual machine steps between two checks for a requested stop.
constexpr int kStepsBetweenLooks = 10'000;

int wants_to_stop(void* stop) {
  return static_cast<std::stop_token*>(stop)->stop_requested() ? 1 : 0;
}

// A path as a URI's, in which '?', '#' and '%' have a meaning.
std::string uri_of(const std::string& path) {
  std::string uri = "file:";
  // Without a slash, "//host" could be read from the start of a path.
  if (!path.starts_with('/')) uri += "./";
  for (const char c : path) {
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                       c == '/' || c == '.' || c == '-' || c == '_';
    if (plain) {
      uri += c;
    } else {
      uri += fmt::format("%{:02X}", static_cast<unsigned char>(c));
    }
  }
  // "//host/..." is an authority.
  const std::size_t start = std::strlen("file:");
  while (uri.compare(start, 2, "//") == 0) uri.erase(start, 1);
  return uri;
}

void require_regular_file(const fs::path& path, const std::string& name, Access access) {
  std::error_code failure;
  const fs::file_status status = fs::status(path, failure);
  if (status.type() == fs::file_type::not_found) {
    if (access == Access::kCreate) return;
    throw Error(ErrorKind::kInput, name, "no such file", "an SQLite database");
  }
  if (failure) throw Error(ErrorKind::kInput, name, failure.message(), "an SQLite database");
  reject_if(status.type() != fs::file_type::regular, name,
            status.type() == fs::file_type::directory ? "is a folder" : "is no regular file",
            "an SQLite database");
}

std::uint64_t size_of(const fs::path& path) {
  std::error_code failure;
  const std::uintmax_t size = fs::file_size(path, failure);
  return failure ? 0 : static_cast<std::uint64_t>(size);
}

void configure(sqlite3* handle, int what, int value) {
  sqlite3_db_config(handle, what, value, nullptr);
}

// SQLite is also out of memory, however much there is, if a row claims to be longer than it can handle.
bool is_room_for_longest_value(sqlite3* handle) {
  if (handle == nullptr) return false;
  void* const room =
      sqlite3_malloc64(static_cast<sqlite3_uint64>(sqlite3_limit(handle, SQLITE_LIMIT_LENGTH, -1)));
  sqlite3_free(room);
  return room != nullptr;
}

ColumnType type_of(int code) {
  switch (code) {
    case SQLITE_INTEGER:
      return ColumnType::kInteger;
    case SQLITE_FLOAT:
      return ColumnType::kReal;
    case SQLITE_TEXT:
      return ColumnType::kText;
    case SQLITE_BLOB:
      return ColumnType::kBlob;
    default:
      return ColumnType::kNull;
  }
}

class SqliteConnection : public storage::detail::Connection {
 public:
  SqliteConnection(const fs::path& path, const OpenOptions& options);
  ~SqliteConnection() override { sqlite3_close_v2(handle_); }

  std::unique_ptr<storage::detail::Cursor> prepare(std::string_view sql) override;
  void execute(const std::string& sql) override {
    const int code = sqlite3_exec(handle_, sql.c_str(), nullptr, nullptr, nullptr);
    if (code != SQLITE_OK) fail(code, sql);
  }
  std::int64_t changes() const noexcept override { return sqlite3_changes64(handle_); }
  bool in_transaction() const noexcept override { return sqlite3_get_autocommit(handle_) == 0; }
  void begin(Transaction::Kind kind) override {
    execute(kind == Transaction::Kind::kRead ? "BEGIN" : "BEGIN IMMEDIATE");
  }
  void commit() override { execute("COMMIT"); }
  void roll_back() noexcept override {
    // SQLite ends some transactions itself, e.g. if the disk is full. Closing the connection rolls others back.
    if (in_transaction()) sqlite3_exec(handle_, "ROLLBACK", nullptr, nullptr, nullptr);
  }

  /// @throws cairn::Error for SQLite's error `code`, always
  /// @param doing the failed action, e.g. the statement
  [[noreturn]] void fail(int code, std::string_view doing) const;
  sqlite3* handle() const { return handle_; }

 private:
  void configure_all(const fs::path& path, const OpenOptions& options);

  sqlite3* handle_ = nullptr;
  std::stop_token stop_;
  bool untrusted_;
};

void SqliteConnection::fail(int code, std::string_view doing) const {
  // Prefers the extended code, which is more specific.
  const int extended = handle_ == nullptr ? code : sqlite3_extended_errcode(handle_);
  const int primary = code & 0xff;
  std::string why = handle_ == nullptr || (extended & 0xff) != primary ? sqlite3_errstr(code)
                                                                       : sqlite3_errmsg(handle_);
  switch (primary) {
    case SQLITE_INTERRUPT:
      throw Error(ErrorKind::kCancelled, name, "stopped as asked", "");
    case SQLITE_NOTADB:
      throw Error(ErrorKind::kInput, name, "no SQLite database, or a damaged one",
                  "an SQLite database");
    case SQLITE_CORRUPT:
      throw Error(ErrorKind::kInput, name, "damaged: " + printable(why), "a sound SQLite database");
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
      throw Error(ErrorKind::kStorage, name,
                  "in use by another process, which did not finish in time",
                  "to be tried again later");
    case SQLITE_FULL:
      throw Error(ErrorKind::kStorage, name, "no space is left for it", "a disk with space");
    case SQLITE_READONLY:
      throw Error(ErrorKind::kStorage, name, "cannot be written: " + why, "permission to write");
    case SQLITE_IOERR:
    case SQLITE_CANTOPEN:
    case SQLITE_PERM:
    case SQLITE_AUTH:
    case SQLITE_PROTOCOL:
    case SQLITE_NOLFS: {
      const int number = handle_ == nullptr ? 0 : sqlite3_system_errno(handle_);
      if (number != 0) why += fmt::format(" ({})", std::strerror(number));
      throw Error(ErrorKind::kStorage, name, why, "");
    }
    case SQLITE_NOMEM:
      reject_if(is_room_for_longest_value(handle_), name,
                "damaged, or memory was short for a moment: SQLite is out of memory",
                "a sound SQLite database");
      throw Error(ErrorKind::kStorage, name, "out of memory", "");
    case SQLITE_MISUSE:
    case SQLITE_RANGE:
      throw Error(ErrorKind::kMisuse, name, fmt::format("{} at {}", why, printable(doing)), "");
    default:
      throw Error(untrusted_ ? ErrorKind::kInput : ErrorKind::kStorage, name,
                  fmt::format("{} at {}", printable(why), printable(doing)), "");
  }
}

SqliteConnection::SqliteConnection(const fs::path& path, const OpenOptions& options)
    : Connection(path.string()), stop_(options.stop), untrusted_(options.untrusted) {
  refuse_if(options.immutable && options.access != Access::kRead, "OpenOptions.immutable",
            "true with write access", "read access: nobody may write what is immutable");
  require_regular_file(path, name, options.access);

  int flags = SQLITE_OPEN_URI | SQLITE_OPEN_NOMUTEX | SQLITE_OPEN_EXRESCODE;
  if (options.access == Access::kRead) flags |= SQLITE_OPEN_READONLY;
  if (options.access != Access::kRead) flags |= SQLITE_OPEN_READWRITE;
  if (options.access == Access::kCreate) flags |= SQLITE_OPEN_CREATE;
  std::string uri = uri_of(path.string());
  if (options.immutable) uri += "?immutable=1";
  try {
    const int opened = sqlite3_open_v2(uri.c_str(), &handle_, flags, nullptr);
    if (opened != SQLITE_OK) fail(opened, "opening");
    configure_all(path, options);
  } catch (...) {
    sqlite3_close_v2(handle_);  // no destructor runs after a failed constructor
    throw;
  }
}

void SqliteConnection::configure_all(const fs::path& path, const OpenOptions& options) {
  sqlite3_busy_timeout(handle_,
                       static_cast<int>(std::clamp<std::int64_t>(options.busy_timeout.count(), 0,
                                                                 std::numeric_limits<int>::max())));
  configure(handle_, SQLITE_DBCONFIG_ENABLE_LOAD_EXTENSION, 0);
  configure(handle_, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0);
  configure(handle_, SQLITE_DBCONFIG_DEFENSIVE, 1);
  configure(handle_, SQLITE_DBCONFIG_DQS_DDL, 0);
  configure(handle_, SQLITE_DBCONFIG_DQS_DML, 0);
  sqlite3_limit(handle_, SQLITE_LIMIT_ATTACHED, 0);
  sqlite3_limit(handle_, SQLITE_LIMIT_WORKER_THREADS, 0);
  std::uint64_t longest = kLongestValue;
  if (options.untrusted) {
    configure(handle_, SQLITE_DBCONFIG_ENABLE_TRIGGER, 0);
    configure(handle_, SQLITE_DBCONFIG_ENABLE_VIEW, 0);
    sqlite3_limit(handle_, SQLITE_LIMIT_SQL_LENGTH, 100'000);
    sqlite3_limit(handle_, SQLITE_LIMIT_COLUMN, 200);
    sqlite3_limit(handle_, SQLITE_LIMIT_EXPR_DEPTH, 50);
    sqlite3_limit(handle_, SQLITE_LIMIT_COMPOUND_SELECT, 10);
    sqlite3_limit(handle_, SQLITE_LIMIT_VDBE_OP, 25'000);
    sqlite3_limit(handle_, SQLITE_LIMIT_FUNCTION_ARG, 16);
    sqlite3_limit(handle_, SQLITE_LIMIT_LIKE_PATTERN_LENGTH, 1'000);
    sqlite3_limit(handle_, SQLITE_LIMIT_TRIGGER_DEPTH, 1);
    // A value of the file cannot be longer than the file and its journal.
    const std::uint64_t added =
        options.longest_written.value_or(options.access == Access::kRead ? 0 : kLongestValue);
    fs::path journal = path;
    journal += "-wal";
    longest = std::min(longest, size_of(path) + size_of(journal) + added + 100'000);
  }
  sqlite3_limit(handle_, SQLITE_LIMIT_LENGTH, static_cast<int>(longest));
  sqlite3_progress_handler(handle_, kStepsBetweenLooks, wants_to_stop, &stop_);
  // Not memory-mapped, because accessing a file that another program truncated would kill the process.
  execute("PRAGMA mmap_size = 0");
  if (options.untrusted) execute("PRAGMA cell_size_check = ON");
  // Reads the header and the schema, which fails for other files.
  prepare("SELECT count(*) FROM sqlite_schema")->step();
}

class SqliteCursor : public storage::detail::Cursor {
 public:
  SqliteCursor(const SqliteConnection& connection, std::string_view sql)
      : connection_(connection), sql_(sql) {
    const char* rest = nullptr;
    check(sqlite3_prepare_v3(connection.handle(), sql_.c_str(), static_cast<int>(sql_.size()) + 1,
                             0, &statement_, &rest));
    const std::string_view left = rest == nullptr ? std::string_view() : std::string_view(rest);
    if (statement_ == nullptr || left.find_first_not_of(" \t\r\n;") != left.npos) {
      sqlite3_finalize(statement_);
      throw Error(ErrorKind::kMisuse, connection.name, "SQL " + printable(sql), "one statement");
    }
  }
  ~SqliteCursor() override { sqlite3_finalize(statement_); }
  SqliteCursor(const SqliteCursor&) = delete;
  SqliteCursor& operator=(const SqliteCursor&) = delete;

  void bind(int parameter, std::int64_t value) override {
    check(sqlite3_bind_int64(statement_, parameter, value));
  }
  void bind(int parameter, double value) override {
    check(sqlite3_bind_double(statement_, parameter, value));
  }
  // A null pointer would bind NULL, which an empty text or blob is not.
  void bind(int parameter, std::string_view text) override {
    check(sqlite3_bind_text64(statement_, parameter, text.data() == nullptr ? "" : text.data(),
                              text.size(), SQLITE_TRANSIENT, SQLITE_UTF8));
  }
  void bind(int parameter, std::span<const std::byte> blob) override {
    const void* const data = blob.data() == nullptr ? static_cast<const void*>("") : blob.data();
    check(sqlite3_bind_blob64(statement_, parameter, data, blob.size(), SQLITE_TRANSIENT));
  }
  void bind(int parameter, std::nullptr_t) override {
    check(sqlite3_bind_null(statement_, parameter));
  }

  bool step() override {
    const int code = sqlite3_step(statement_);
    if (code == SQLITE_ROW) return true;
    if (code != SQLITE_DONE) {
      try {
        connection_.fail(code, sql_);
      } catch (...) {
        // Resets after the message is made, which resetting would lose; without it, the statement would keep
        // its locks.
        sqlite3_reset(statement_);
        throw;
      }
    }
    sqlite3_reset(statement_);
    return false;
  }

  void reset() override {
    sqlite3_reset(statement_);
    sqlite3_clear_bindings(statement_);
  }

  const std::string& database() const override { return connection_.name; }
  std::string column_name(int column) const override {
    const char* const name = sqlite3_column_name(statement_, column);
    return name == nullptr ? fmt::format("column {}", column) : name;
  }
  ColumnType type(int column) const override {
    return type_of(sqlite3_column_type(statement_, column));
  }
  std::int64_t integer(int column) const override {
    return sqlite3_column_int64(statement_, column);
  }
  double real(int column) const override { return sqlite3_column_double(statement_, column); }

  // SQLite returns a null pointer for an empty value, but also if memory is exhausted.
  std::string_view text(int column) const override {
    const auto* const data = reinterpret_cast<const char*>(sqlite3_column_text(statement_, column));
    if (data == nullptr) connection_.fail(SQLITE_NOMEM, sql_);
    return {data, static_cast<std::size_t>(sqlite3_column_bytes(statement_, column))};
  }

  std::span<const std::byte> blob(int column) const override {
    const auto* const data = static_cast<const std::byte*>(sqlite3_column_blob(statement_, column));
    const int size = sqlite3_column_bytes(statement_, column);
    const bool is_short =
        data == nullptr && (size > 0 || sqlite3_errcode(connection_.handle()) == SQLITE_NOMEM);
    if (is_short) connection_.fail(SQLITE_NOMEM, sql_);
    return {data, static_cast<std::size_t>(size)};
  }

 private:
  void check(int code) const {
    if (code != SQLITE_OK) connection_.fail(code, sql_);
  }

  const SqliteConnection& connection_;
  std::string sql_;
  sqlite3_stmt* statement_ = nullptr;
};

std::unique_ptr<storage::detail::Cursor> SqliteConnection::prepare(std::string_view sql) {
  return std::make_unique<SqliteCursor>(*this, sql);
}

}  // namespace

Database::Database(const fs::path& path, const OpenOptions& options)
    : storage::Database(std::make_unique<SqliteConnection>(path, options)) {}

bool Database::has_table(std::string_view name) {
  Statement statement =
      prepare("SELECT 1 FROM sqlite_schema WHERE type = 'table' AND name = ?1 COLLATE NOCASE");
  return statement.bind_all(name).step();
}

std::vector<std::string> Database::columns(std::string_view table) {
  std::vector<std::string> names;
  if (!has_table(table)) return names;
  Statement statement = prepare("SELECT name FROM pragma_table_info(?1) ORDER BY cid");
  statement.bind_all(table);
  while (statement.step()) names.emplace_back(statement.text(0));
  return names;
}

}  // namespace cairn::sqlite
