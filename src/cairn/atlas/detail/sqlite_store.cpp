// SPDX-License-Identifier: BSD-3-Clause
#include <array>
#include <cerrno>
#include <fstream>
#include <map>
#include <string_view>
#include <system_error>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/vfs.h>
#include <unistd.h>

#include "cairn/atlas/detail/sql_store.hpp"
#include "cairn/atlas/detail/stores.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

// "CRNA": distinguishes an atlas from other SQLite files.
constexpr std::int64_t kApplicationId = 0x43524e41;

// By schema: what brings an atlas from the schema before to it.
constexpr std::array<const char*, kAtlasSchema> kMigrations = {
    R"sql(
CREATE TABLE commits (
  id INTEGER PRIMARY KEY, time_ms INTEGER NOT NULL, author TEXT NOT NULL, host TEXT NOT NULL,
  verb TEXT NOT NULL, text TEXT NOT NULL, undoes INTEGER, run INTEGER NOT NULL, digest BLOB NOT NULL
) STRICT;
CREATE TABLE changes (
  commit_id INTEGER NOT NULL, number INTEGER NOT NULL, kind INTEGER NOT NULL,
  object INTEGER NOT NULL, value INTEGER, PRIMARY KEY (commit_id, number)
) STRICT, WITHOUT ROWID;
CREATE TABLE maps (id INTEGER PRIMARY KEY, hash BLOB NOT NULL UNIQUE, bytes INTEGER NOT NULL) STRICT;
CREATE TABLE map_chunks (
  map INTEGER NOT NULL, number INTEGER NOT NULL, bytes BLOB NOT NULL, PRIMARY KEY (map, number)
) STRICT;
CREATE TABLE nodes (
  id INTEGER PRIMARY KEY, name TEXT NOT NULL, session TEXT NOT NULL, map BLOB NOT NULL,
  length_unit INTEGER NOT NULL, frames INTEGER NOT NULL, landmarks INTEGER NOT NULL,
  observations INTEGER NOT NULL, extent BLOB NOT NULL, digest BLOB NOT NULL
) STRICT;
CREATE TABLE links (
  id INTEGER PRIMARY KEY, target INTEGER NOT NULL, source INTEGER NOT NULL, kind INTEGER NOT NULL,
  verdict INTEGER NOT NULL, probability REAL, reason TEXT NOT NULL, target_from_source BLOB,
  covariance BLOB, covariance_with_scale BLOB, digest BLOB NOT NULL
) STRICT;
CREATE TABLE poses (
  id INTEGER PRIMARY KEY, node INTEGER NOT NULL, frame INTEGER NOT NULL,
  frame_from_node BLOB NOT NULL, covariance BLOB NOT NULL, digest BLOB NOT NULL
) STRICT;
)sql"};

class SqliteStore final : public detail::SqlStore {
 public:
  using SqlStore::SqlStore;

 private:
  void check_files(std::vector<std::string>& problems) override {
    storage::Statement rows = database().prepare("PRAGMA integrity_check(20)");
    while (rows.step()) {
      if (rows.text(0) == "ok") continue;
      problems.push_back(fmt::format("{}: {}", name(), printable(rows.text(0))));
    }
  }
  void after_compact() override {
    database().execute("PRAGMA incremental_vacuum");
    database().execute("PRAGMA wal_checkpoint(TRUNCATE)");
    std::error_code ignored;
    fs::remove(merged_world_file(name()), ignored);
  }
};

fs::path folder_of(const fs::path& path) {
  return path.has_parent_path() ? path.parent_path() : fs::path(".");
}

void require_local(const fs::path& path, const AtlasStoreOptions& options) {
  if (options.insist) return;
  struct statfs system {};
  std::error_code ignored;
  const fs::path there = fs::exists(path, ignored) ? path : folder_of(path);
  if (::statfs(there.c_str(), &system) != 0) return;  // opening it will throw with the reason
  const char* const kind = detail::network_file_system(static_cast<long>(system.f_type));
  if (kind == nullptr) return;
  throw Error(
      ErrorKind::kStorage, path.string(), fmt::format("lies on {}", kind),
      "a local disk: locks over a network can fail and damage it; --insist if you are sure");
}

void configure(sqlite::Database& database) {
  database.execute("PRAGMA synchronous = FULL");
  database.execute("PRAGMA foreign_keys = ON");
}

// A copy that another program made may keep a rollback journal instead.
void keep_write_ahead_log(sqlite::Database& database, const fs::path& path) {
  if (database.text("PRAGMA journal_mode = WAL") == "wal") return;
  throw Error(ErrorKind::kStorage, path.string(), "a write-ahead log cannot be kept", "");
}

// An atlas has a write-ahead log and no rollback journal. SQLite would apply one, and delete any file that it names.
void refuse_journal(const fs::path& path) {
  std::error_code failure;
  // SQLite puts its files beside the file that a symbolic link leads to.
  fs::path journal = fs::canonical(path, failure);
  if (failure) return;  // opening it will throw with the reason
  journal += "-journal";
  const fs::file_status status = fs::status(journal, failure);
  if (!fs::exists(status)) return;
  if (fs::is_regular_file(status) && fs::file_size(journal, failure) == 0) return;
  throw Error(ErrorKind::kInput, journal.string(),
              "a rollback journal beside an atlas: applying it could delete other files",
              "an atlas without one, as cairn never writes one");
}

void migrate(sqlite::Database& database, std::int64_t from) {
  for (std::int64_t schema = from; schema < kAtlasSchema; ++schema) {
    database.execute(kMigrations[static_cast<std::size_t>(schema)]);
  }
  database.execute(fmt::format("PRAGMA user_version = {}", kAtlasSchema));
}

// Where an atlas is made until it is complete.
fs::path unfinished_of(const fs::path& atlas) {
  return folder_of(atlas) / fmt::format(".{}.cairn-unfinished", atlas.filename().string());
}

// A process that was killed when the atlas was complete has left its file that name, too.
void remove_second_name(const fs::path& atlas) {
  std::error_code ignored;
  const fs::path second = unfinished_of(atlas);
  if (fs::equivalent(atlas, second, ignored)) fs::remove(second, ignored);
}

// The file in which an atlas is made until it is complete, locked as long as this lives. One that a killed process
// left is taken over.
class Unfinished {
 public:
  explicit Unfinished(const fs::path& atlas)
      : path_(unfinished_of(atlas)),
        beside_{path_.string() + "-wal", path_.string() + "-shm", path_.string() + "-journal"} {
    for (;;) {
      descriptor_ = ::open(path_.c_str(), O_RDWR | O_CREAT | O_NOFOLLOW | O_CLOEXEC, 0666);
      if (descriptor_ < 0) fail(atlas, errno);
      if (::flock(descriptor_, LOCK_EX | LOCK_NB) != 0) {
        const int error_number = errno;
        ::close(descriptor_);
        if (error_number != EWOULDBLOCK) fail(atlas, error_number);
        throw Error(ErrorKind::kStorage, atlas.string(), "another process is making it",
                    "to be tried again later");
      }
      const nlink_t names = names_in_place();
      if (names == 1) break;
      // A process that was killed while it gave the complete file its second name, that of an atlas: not to be touched.
      if (names > 1) ::unlink(path_.c_str());
      ::close(descriptor_);
    }
    // SQLite deletes logs and journals beside an empty file, too; but a journal can name any file to be deleted.
    remove_beside();
    if (::ftruncate(descriptor_, 0) == 0) return;
    const int error_number = errno;
    ::unlink(path_.c_str());
    ::close(descriptor_);
    fail(atlas, error_number);
  }
  // Not before the database is closed: closing any descriptor of a file gives up SQLite's locks on it.
  ~Unfinished() {
    remove_beside();
    ::unlink(path_.c_str());
    ::close(descriptor_);
  }
  Unfinished(const Unfinished&) = delete;
  Unfinished& operator=(const Unfinished&) = delete;

  const fs::path& path() const { return path_; }

 private:
  [[noreturn]] static void fail(const fs::path& atlas, int error_number) {
    throw Error(ErrorKind::kStorage, atlas.string(),
                "cannot be made: " + std::generic_category().message(error_number), "");
  }
  // How many names the open file has; 0: another process has just finished, and this name is not its any more.
  nlink_t names_in_place() const {
    struct stat open = {};
    struct stat named = {};
    const bool known = ::fstat(descriptor_, &open) == 0 && ::lstat(path_.c_str(), &named) == 0;
    return known && open.st_ino == named.st_ino && open.st_dev == named.st_dev ? open.st_nlink : 0;
  }
  void remove_beside() const {
    for (const std::string& beside : beside_) ::unlink(beside.c_str());
  }

  fs::path path_;
  std::array<std::string, 3> beside_;  // SQLite's own
  int descriptor_ = -1;
};

void refuse_existing(const fs::path& path) {
  throw Error(ErrorKind::kMisuse, path.string(), "exists already", "a name that is free");
}

// SQLite would apply what an atlas that was moved or deleted has left beside its name.
void refuse_left_behind(const fs::path& path) {
  for (const char* const ending : {"-wal", "-journal"}) {
    fs::path beside = path;
    beside += ending;
    std::error_code ignored;
    const fs::file_status status = fs::symlink_status(beside, ignored);
    if (!fs::exists(status)) continue;
    // Whoever only reads an atlas leaves an empty one.
    if (fs::is_regular_file(status) && fs::file_size(beside, ignored) == 0 && !ignored) continue;
    throw Error(
        ErrorKind::kStorage, beside.string(), "is left of another atlas of that name",
        "a name that is free; this file may hold the last changes of that atlas, and belongs "
        "beside it under its new name");
  }
}

}  // namespace

const char* detail::network_file_system(long type) {
  switch (static_cast<unsigned long>(type) & 0xffffffffUL) {
    case 0x6969:
      return "NFS";
    case 0x517b:
    case 0xff534d42:
    case 0xfe534d42:
      return "SMB, a network file system";
    case 0x01021997:
      return "9P, a network file system";
    case 0x65735546:
      return "FUSE, which may be a network file system";
    case 0x00c36400:
      return "Ceph";
    case 0x0bd00bd0:
      return "Lustre";
    case 0x47504653:
      return "GPFS";
    case 0x19830326:
      return "BeeGFS";
    case 0x5346414f:
    case 0x6b414653:
      return "AFS";
    case 0x73757245:
      return "Coda";
    case 0x564c:
      return "NCP";
    default:
      return nullptr;
  }
}

void detail::create_sqlite_store(const fs::path& path, const AtlasStoreOptions& options) {
  std::error_code failure;
  if (fs::exists(fs::symlink_status(path, failure))) refuse_existing(path);
  refuse_left_behind(path);
  require_local(path, options);
  const Unfinished unfinished(path);
  const fs::path& temporary = unfinished.path();
  try {
    {
      sqlite::Database database(
          temporary,
          {.access = sqlite::Access::kCreate, .busy_timeout = options.wait, .stop = options.stop});
      configure(database);
      // So that compact() can give space back.
      database.execute("PRAGMA auto_vacuum = INCREMENTAL");
      sqlite::Transaction transaction(database);
      database.execute(fmt::format("PRAGMA application_id = {}", kApplicationId));
      migrate(database, 0);
      transaction.commit();
      // Only now: what a journal of that kind holds reaches the file when it is closed, which reports no failure.
      keep_write_ahead_log(database, path);
    }
    // Unlike rename(), link() never replaces a file that another process has made meanwhile.
    fs::create_hard_link(temporary, path, failure);
    if (failure == std::errc::file_exists) refuse_existing(path);
    if (failure) fs::rename(temporary, path);
    sync_files(folder_of(path));
  } catch (const fs::filesystem_error& error) {
    throw Error(ErrorKind::kStorage, path.string(), error.code().message(), "a place to write to");
  } catch (const Error& error) {
    // The temporary file's name means nothing to people.
    std::string text = error.what();
    const std::size_t at = text.find(temporary.string());
    if (at == std::string::npos) throw;
    throw Error(error.kind(), "", text.replace(at, temporary.string().size(), path.string()), "");
  }
}

namespace {

sqlite::Database open_database(const fs::path& path, const AtlasStoreOptions& options) {
  std::error_code ignored;
  if (!fs::exists(path, ignored)) {
    throw Error(ErrorKind::kInput, path.string(), "no such file",
                "an atlas; 'cairn atlas init' makes one");
  }
  require_local(path, options);
  refuse_journal(path);
  sqlite::OpenOptions how{
      .access = options.read_only ? sqlite::Access::kRead : sqlite::Access::kWrite,
      .longest_written = 2 * detail::kChunkBytes,
      .busy_timeout = options.wait,
      .stop = options.stop};
  const auto open = [&] {
    sqlite::Database database(path, how);
    const std::int64_t application = database.integer("PRAGMA application_id");
    reject_if(application != kApplicationId, path.string(), "an SQLite database, but no atlas",
              "an atlas");
    return database;
  };
  if (!options.read_only) return open();
  try {
    return open();
  } catch (const Error& error) {
    // If no file can be created beside it, no process can write, unless a journal has to be recovered.
    fs::path journal = path;
    journal += "-wal";
    const bool journal_waits = fs::exists(journal, ignored) && fs::file_size(journal, ignored) > 0;
    const bool can_write = ::access(folder_of(path).c_str(), W_OK) == 0;
    if (error.kind() != ErrorKind::kStorage || can_write || journal_waits) throw;
    how.immutable = true;
    return open();
  }
}

void require_schema(sqlite::Database& database, const fs::path& path, bool read_only) {
  const std::int64_t schema = database.integer("PRAGMA user_version");
  reject_if(schema > kAtlasSchema || schema < 1, path.string(),
            fmt::format("an atlas of schema {}", schema),
            fmt::format("schema {} or older: a newer version of cairn wrote it", kAtlasSchema));
  if (schema == kAtlasSchema) return;
  reject_if(read_only, path.string(), fmt::format("an atlas of schema {}", schema),
            fmt::format("schema {}: a command that writes brings it there", kAtlasSchema));
  sqlite::Transaction transaction(database);
  // Another process may have been faster.
  migrate(database, database.integer("PRAGMA user_version"));
  transaction.commit();
}

// Statements of the tables by their names, as SQLite keeps them: without the semicolon.
std::map<std::string, std::string> own_tables() {
  std::map<std::string, std::string> tables;
  constexpr std::string_view kStart = "CREATE TABLE ";
  for (const std::string_view migration : kMigrations) {
    for (std::size_t at = migration.find(kStart); at != std::string::npos;) {
      const std::string_view statement = migration.substr(at, migration.find(';', at) - at);
      const std::size_t name = kStart.size();
      tables.emplace(statement.substr(name, statement.find(' ', name) - name), statement);
      at = migration.find(kStart, at + statement.size());
    }
  }
  return tables;
}

// Generated columns, checks, indexes and virtual tables of a file from others could take any time and memory.
// @param all whether none of our own may be missing
void require_own_tables(sqlite::Database& database, const fs::path& path, bool all) {
  std::map<std::string, std::string> missing = own_tables();
  // The indexes of keys have no statement of their own.
  sqlite::Statement rows =
      database.prepare("SELECT name, sql FROM sqlite_schema WHERE sql IS NOT NULL");
  while (rows.step()) {
    const std::string name(rows.text(0));
    const auto own = missing.find(name);
    if (own == missing.end() || own->second != rows.text(1)) {
      throw Error(ErrorKind::kInput, path.string(),
                  fmt::format("{} in its schema is not what cairn makes", printable(name)),
                  "an atlas as cairn made it; sqlite3 can drop what another program added");
    }
    missing.erase(own);
  }
  if (!all || missing.empty()) return;
  fail_as_damaged(path.string(), fmt::format("the table {}", missing.begin()->first));
}

}  // namespace

sqlite::Database detail::open_sqlite_database(const fs::path& path,
                                              const AtlasStoreOptions& options, bool whole) {
  sqlite::Database database = open_database(path, options);
  require_schema(database, path, options.read_only);
  require_own_tables(database, path, whole);
  if (options.read_only) return database;
  configure(database);
  keep_write_ahead_log(database, path);
  remove_second_name(path);
  return database;
}

fs::path merged_world_file(const fs::path& atlas) {
  return atlas.string() + ".merged.cairn";
}

bool is_atlas_file(const fs::path& path) {
  // The header of a SQLite file: its name, and the application's number at byte 68, highest byte first.
  constexpr std::string_view kName("SQLite format 3\0", 16);
  constexpr std::size_t kApplicationAt = 68;
  std::array<char, kApplicationAt + 4> head{};
  std::ifstream file(path, std::ios::binary);
  if (!file.read(head.data(), head.size())) return false;
  if (std::string_view(head.data(), kName.size()) != kName) return false;
  std::int64_t application = 0;
  for (std::size_t i = kApplicationAt; i < head.size(); ++i) {
    application = 256 * application + static_cast<unsigned char>(head[i]);
  }
  return application == kApplicationId;
}

std::unique_ptr<AtlasStore> detail::open_sqlite_store(const fs::path& path,
                                                      const AtlasStoreOptions& options,
                                                      bool whole) {
  return std::make_unique<SqliteStore>(open_sqlite_database(path, options, whole), options);
}

}  // namespace cairn
