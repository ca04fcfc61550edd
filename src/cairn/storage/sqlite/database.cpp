// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/storage/sqlite/database.hpp"

#include <algorithm>
#include <cstring>
#include <limits>
#include <utility>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/storage/detail/sqlite_connection.hpp"

namespace cairn::sqlite {
namespace {

namespace fs = std::filesystem;

// Most bytes of a text or blob, and of a row.
constexpr std::uint64_t kLongestValue = 1'000'000'000;

// Virtual machine steps between two checks for a requested stop.
constexpr int kStepsBetweenLooks = 10'000;

int wants_to_stop(void* connection) {
  return static_cast<detail::Connection*>(connection)->stop.stop_requested() ? 1 : 0;
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
  if (status.type() != fs::file_type::regular) {
    throw Error(ErrorKind::kInput, name,
                status.type() == fs::file_type::directory ? "is a folder" : "is no regular file",
                "an SQLite database");
  }
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

}  // namespace

void detail::Connection::fail(int code, std::string_view doing) const {
  // Prefers the extended code, which is more specific.
  const int extended = handle == nullptr ? code : sqlite3_extended_errcode(handle);
  const int primary = code & 0xff;
  std::string why = handle == nullptr || (extended & 0xff) != primary ? sqlite3_errstr(code)
                                                                      : sqlite3_errmsg(handle);
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
      const int number = handle == nullptr ? 0 : sqlite3_system_errno(handle);
      if (number != 0) why += fmt::format(" ({})", std::strerror(number));
      throw Error(ErrorKind::kStorage, name, why, "");
    }
    case SQLITE_NOMEM:
      if (is_room_for_longest_value(handle)) {
        throw Error(ErrorKind::kInput, name,
                    "damaged, or memory was short for a moment: SQLite is out of memory",
                    "a sound SQLite database");
      }
      throw Error(ErrorKind::kStorage, name, "out of memory", "");
    case SQLITE_MISUSE:
    case SQLITE_RANGE:
      throw Error(ErrorKind::kMisuse, name, fmt::format("{} at {}", why, printable(doing)), "");
    default:
      throw Error(untrusted ? ErrorKind::kInput : ErrorKind::kStorage, name,
                  fmt::format("{} at {}", printable(why), printable(doing)), "");
  }
}

Database::Database(const fs::path& path, const OpenOptions& options)
    : connection_(std::make_unique<detail::Connection>()) {
  connection_->name = path.string();
  connection_->stop = options.stop;
  connection_->untrusted = options.untrusted;
  if (options.immutable && options.access != Access::kRead) {
    throw Error(ErrorKind::kMisuse, "OpenOptions.immutable", "true with write access",
                "read access: nobody may write what is immutable");
  }
  require_regular_file(path, connection_->name, options.access);

  int flags = SQLITE_OPEN_URI | SQLITE_OPEN_NOMUTEX | SQLITE_OPEN_EXRESCODE;
  if (options.access == Access::kRead) flags |= SQLITE_OPEN_READONLY;
  if (options.access != Access::kRead) flags |= SQLITE_OPEN_READWRITE;
  if (options.access == Access::kCreate) flags |= SQLITE_OPEN_CREATE;
  std::string uri = uri_of(path.string());
  if (options.immutable) uri += "?immutable=1";
  const int opened = sqlite3_open_v2(uri.c_str(), &connection_->handle, flags, nullptr);
  if (opened != SQLITE_OK) {
    // Closes the handle here, because no destructor runs after a failed constructor.
    try {
      connection_->fail(opened, "opening");
    } catch (...) {
      sqlite3_close_v2(connection_->handle);
      throw;
    }
  }
  sqlite3* const handle = connection_->handle;
  try {
    sqlite3_busy_timeout(
        handle, static_cast<int>(std::clamp<std::int64_t>(options.busy_timeout.count(), 0,
                                                          std::numeric_limits<int>::max())));
    configure(handle, SQLITE_DBCONFIG_ENABLE_LOAD_EXTENSION, 0);
    configure(handle, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0);
    configure(handle, SQLITE_DBCONFIG_DEFENSIVE, 1);
    configure(handle, SQLITE_DBCONFIG_DQS_DDL, 0);
    configure(handle, SQLITE_DBCONFIG_DQS_DML, 0);
    sqlite3_limit(handle, SQLITE_LIMIT_ATTACHED, 0);
    sqlite3_limit(handle, SQLITE_LIMIT_WORKER_THREADS, 0);
    std::uint64_t longest = kLongestValue;
    if (options.untrusted) {
      configure(handle, SQLITE_DBCONFIG_ENABLE_TRIGGER, 0);
      configure(handle, SQLITE_DBCONFIG_ENABLE_VIEW, 0);
      sqlite3_limit(handle, SQLITE_LIMIT_SQL_LENGTH, 100'000);
      sqlite3_limit(handle, SQLITE_LIMIT_COLUMN, 200);
      sqlite3_limit(handle, SQLITE_LIMIT_EXPR_DEPTH, 50);
      sqlite3_limit(handle, SQLITE_LIMIT_COMPOUND_SELECT, 10);
      sqlite3_limit(handle, SQLITE_LIMIT_VDBE_OP, 25'000);
      sqlite3_limit(handle, SQLITE_LIMIT_FUNCTION_ARG, 16);
      sqlite3_limit(handle, SQLITE_LIMIT_LIKE_PATTERN_LENGTH, 1'000);
      sqlite3_limit(handle, SQLITE_LIMIT_TRIGGER_DEPTH, 1);
      // A value of the file cannot be longer than the file and its journal.
      const std::uint64_t added =
          options.longest_written.value_or(options.access == Access::kRead ? 0 : kLongestValue);
      fs::path journal = path;
      journal += "-wal";
      longest = std::min(longest, size_of(path) + size_of(journal) + added + 100'000);
    }
    sqlite3_limit(handle, SQLITE_LIMIT_LENGTH, static_cast<int>(longest));
    sqlite3_progress_handler(handle, kStepsBetweenLooks, wants_to_stop, connection_.get());
    // Not memory-mapped, because accessing a file that another program truncated would kill the process.
    execute("PRAGMA mmap_size = 0");
    if (options.untrusted) execute("PRAGMA cell_size_check = ON");
    // Reads the header and the schema, which fails for other files.
    prepare("SELECT count(*) FROM sqlite_schema").step();
  } catch (...) {
    sqlite3_close_v2(handle);
    throw;
  }
}

Database::~Database() {
  if (connection_) sqlite3_close_v2(connection_->handle);
}

Database::Database(Database&&) noexcept = default;

Database& Database::operator=(Database&& other) noexcept {
  // The destructor of `other` closes the former connection.
  std::swap(connection_, other.connection_);
  return *this;
}

const std::string& Database::name() const noexcept {
  return connection_->name;
}

Statement Database::prepare(std::string_view sql) {
  return {*connection_, sql};
}

void Database::execute(const std::string& sql) {
  const int code = sqlite3_exec(connection_->handle, sql.c_str(), nullptr, nullptr, nullptr);
  if (code != SQLITE_OK) connection_->fail(code, sql);
}

std::int64_t Database::integer(std::string_view sql) {
  Statement statement = prepare(sql);
  if (!statement.step()) {
    throw Error(ErrorKind::kInput, name(), "no row for " + printable(sql), "one");
  }
  return statement.integer(0);
}

std::string Database::text(std::string_view sql) {
  Statement statement = prepare(sql);
  if (!statement.step()) {
    throw Error(ErrorKind::kInput, name(), "no row for " + printable(sql), "one");
  }
  return std::string(statement.text(0));
}

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

std::int64_t Database::last_row_id() const noexcept {
  return sqlite3_last_insert_rowid(connection_->handle);
}

std::int64_t Database::changes() const noexcept {
  return sqlite3_changes64(connection_->handle);
}

bool Database::in_transaction() const noexcept {
  return sqlite3_get_autocommit(connection_->handle) == 0;
}

Transaction::Transaction(Database& database, Kind kind) : database_(&database) {
  database.execute(kind == Kind::kWrite ? "BEGIN IMMEDIATE" : "BEGIN");
}

Transaction::~Transaction() {
  if (!open_) return;
  try {
    // SQLite ends some transactions itself, e.g. if the disk is full.
    if (database_->in_transaction()) database_->execute("ROLLBACK");
  } catch (...) {
    // Closing the connection rolls it back.
  }
}

void Transaction::commit() {
  database_->execute("COMMIT");
  open_ = false;
}

}  // namespace cairn::sqlite
