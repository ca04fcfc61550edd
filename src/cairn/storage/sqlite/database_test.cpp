// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/storage/sqlite/database.hpp"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"

#include "support/refusal.hpp"
#include "support/temporary_folder.hpp"

namespace cairn::sqlite {
namespace {

using ::testing::HasSubstr;
using testing::message_of;

class SqliteTest : public ::testing::Test {
 protected:
  std::filesystem::path path(const std::string& name = "a.db") const { return folder_ / name; }

  Database fresh(const std::string& name = "a.db") const {
    return Database(path(name), {.access = Access::kCreate, .untrusted = false});
  }

  testing::TemporaryFolder folder_;
};

std::vector<std::byte> bytes_of(const std::string& text) {
  std::vector<std::byte> bytes;
  for (const char c : text) bytes.push_back(static_cast<std::byte>(c));
  return bytes;
}

TEST_F(SqliteTest, GivesBackEveryTypeOfValue) {
  {
    Database database = fresh();
    database.execute("CREATE TABLE t (i, r, s, b, n)");
    database.run("INSERT INTO t VALUES (?1, ?2, ?3, ?4, ?5)", std::int64_t{-1} << 62, 0.1,
                 std::string("a\0b", 3), std::span<const std::byte>(bytes_of("xyz")), nullptr);
    database.run("INSERT INTO t VALUES (?1, ?2, ?3, ?4, ?5)", 7U, std::optional<double>(), "",
                 std::span<const std::byte>(), std::optional<std::string>("given"));
  }
  Database database(path());
  Statement rows = database.prepare("SELECT i, r, s, b, n FROM t ORDER BY rowid");
  ASSERT_TRUE(rows.step());
  EXPECT_EQ(rows.integer(0), std::int64_t{-1} << 62);
  EXPECT_EQ(rows.real(1), 0.1);
  EXPECT_EQ(rows.text(2), std::string("a\0b", 3));
  EXPECT_TRUE(std::ranges::equal(rows.blob(3), bytes_of("xyz")));
  EXPECT_TRUE(rows.is_null(4));
  EXPECT_EQ(rows.optional_text(4), std::nullopt);
  ASSERT_TRUE(rows.step());
  EXPECT_EQ(rows.unsigned_integer(0), 7U);
  EXPECT_EQ(rows.optional_real(1), std::nullopt);
  EXPECT_EQ(rows.type(2), ColumnType::kText);
  EXPECT_EQ(rows.text(2), "");
  EXPECT_EQ(rows.type(3), ColumnType::kBlob);
  EXPECT_TRUE(rows.blob(3).empty());
  EXPECT_EQ(rows.optional_text(4), "given");
  EXPECT_FALSE(rows.step());
}

TEST_F(SqliteTest, NamesFileAndColumnOfAnotherTypeThanExpected) {
  Database database = fresh();
  database.execute("CREATE TABLE t (id, pose); INSERT INTO t VALUES ('one', -3)");
  Statement rows = database.prepare("SELECT id, pose FROM t");
  ASSERT_TRUE(rows.step());
  const std::string id = message_of(ErrorKind::kInput, [&] { rows.integer(0); });
  EXPECT_THAT(id, HasSubstr(path().string()));
  EXPECT_THAT(id, HasSubstr("'id'"));
  EXPECT_THAT(id, HasSubstr("text 'one'"));
  EXPECT_THAT(id, HasSubstr("expected integer"));
  EXPECT_THAT(message_of(ErrorKind::kInput, [&] { rows.unsigned_integer(1); }), HasSubstr("-3"));
  EXPECT_THAT(message_of(ErrorKind::kInput, [&] { rows.blob(1); }), HasSubstr("expected blob"));
  EXPECT_THAT(message_of(ErrorKind::kInput, [&] { rows.text(1); }), HasSubstr("integer -3"));
  EXPECT_EQ(rows.real(1), -3.0);
}

TEST_F(SqliteTest, RefusesWhatIsNoDatabase) {
  EXPECT_THAT(message_of(ErrorKind::kInput, [&] { Database{path("none.db")}; }),
              HasSubstr("no such file"));
  EXPECT_THAT(message_of(ErrorKind::kInput, [&] { Database{folder_.path()}; }),
              HasSubstr("is a folder"));
  ASSERT_EQ(mkfifo(path("pipe").c_str(), 0600), 0);
  EXPECT_THAT(message_of(ErrorKind::kInput, [&] { Database{path("pipe")}; }),
              HasSubstr("no regular file"));
  std::ofstream(path("text.db")) << std::string(5000, 'x');
  EXPECT_THAT(message_of(ErrorKind::kInput, [&] { Database{path("text.db")}; }),
              HasSubstr("no SQLite database"));
  EXPECT_FALSE(std::filesystem::exists(path("none.db")));
}

TEST_F(SqliteTest, ReadAccessWritesNothing) {
  { fresh().execute("CREATE TABLE t (i)"); }
  Database database(path());
  EXPECT_THAT(
      message_of(ErrorKind::kStorage, [&] { database.execute("INSERT INTO t VALUES (1)"); }),
      HasSubstr("cannot be written"));
}

TEST_F(SqliteTest, ReadsAnImmutableFileWithoutAFileBesideIt) {
  {
    Database database = fresh();
    database.execute("PRAGMA journal_mode = WAL; CREATE TABLE t (i); INSERT INTO t VALUES (5)");
  }
  ASSERT_FALSE(std::filesystem::exists(path("a.db-wal")));
  Database database(path(), {.immutable = true});
  EXPECT_EQ(database.integer("SELECT i FROM t"), 5);
  EXPECT_FALSE(std::filesystem::exists(path("a.db-wal")));
  EXPECT_FALSE(std::filesystem::exists(path("a.db-shm")));
  message_of(ErrorKind::kMisuse, [&] {
    Database{path(), {.access = Access::kWrite, .immutable = true}};
  });
}

TEST_F(SqliteTest, OpensPathsWithEveryCharacter) {
  for (const std::string name : {"a?mode=memory", "b#c%41 d", "Größe.db", "'quoted'"}) {
    {
      fresh(name).execute("CREATE TABLE t (i)");
    }
    EXPECT_TRUE(std::filesystem::exists(path(name))) << name;
    EXPECT_TRUE(Database(path(name)).has_table("t")) << name;
  }
}

TEST_F(SqliteTest, OfAnUntrustedFileUsesNeitherViewsNorTriggers) {
  {
    Database database = fresh();
    database.execute(
        "CREATE TABLE real_one (id); INSERT INTO real_one VALUES (1);"
        "CREATE VIEW Node AS WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n)"
        "  SELECT i FROM n;"
        "CREATE TRIGGER bomb AFTER INSERT ON real_one BEGIN DELETE FROM real_one; END");
  }
  Database database(path(), {.access = Access::kWrite});
  EXPECT_FALSE(database.has_table("Node"));
  EXPECT_TRUE(database.columns("Node").empty());
  message_of(ErrorKind::kInput, [&] { database.prepare("SELECT count(*) FROM Node").step(); });
  database.execute("INSERT INTO real_one VALUES (2)");
  EXPECT_EQ(database.integer("SELECT count(*) FROM real_one"), 2);
}

TEST_F(SqliteTest, NeverLoadsExtensionsNorAttachesFiles) {
  Database database = fresh();
  EXPECT_ANY_THROW(database.execute("SELECT load_extension('libm.so.6')"));
  EXPECT_ANY_THROW(database.execute("ATTACH '" + path("other.db").string() + "' AS other"));
  EXPECT_FALSE(std::filesystem::exists(path("other.db")));
}

TEST_F(SqliteTest, ListsTablesAndColumns) {
  Database database = fresh();
  database.execute("CREATE TABLE images (image_id INTEGER PRIMARY KEY, \"name\" TEXT, camera_id)");
  EXPECT_TRUE(database.has_table("Images"));
  EXPECT_FALSE(database.has_table("cameras"));
  EXPECT_THAT(database.columns("images"), ::testing::ElementsAre("image_id", "name", "camera_id"));
}

TEST_F(SqliteTest, TakesOneStatementAtATime) {
  Database database = fresh();
  message_of(ErrorKind::kMisuse, [&] { database.prepare("SELECT 1; SELECT 2"); });
  message_of(ErrorKind::kMisuse, [&] { database.prepare(" -- nothing"); });
  EXPECT_EQ(database.integer("SELECT 1;  "), 1);
  EXPECT_ANY_THROW(database.prepare("SELECT absent FROM nowhere"));
  EXPECT_ANY_THROW(database.run("SELECT ?1", 1, 2));
}

TEST_F(SqliteTest, UndoesATransactionThatWasNotCommitted) {
  Database database = fresh();
  database.execute("CREATE TABLE t (i)");
  {
    const Transaction transaction(database);
    database.run("INSERT INTO t VALUES (?1)", 1);
    EXPECT_TRUE(database.in_transaction());
  }
  EXPECT_FALSE(database.in_transaction());
  EXPECT_EQ(database.integer("SELECT count(*) FROM t"), 0);
  {
    Transaction transaction(database);
    database.run("INSERT INTO t VALUES (?1)", 2);
    EXPECT_EQ(database.changes(), 1);
    transaction.commit();
  }
  EXPECT_EQ(database.integer("SELECT i FROM t"), 2);
}

TEST_F(SqliteTest, WaitsForAnotherWriterAndThenSaysSo) {
  Database first = fresh();
  first.execute("CREATE TABLE t (i)");
  Database second(path(),
                  {.access = Access::kWrite, .busy_timeout = std::chrono::milliseconds(20)});
  {
    const Transaction transaction(first);
    const std::string message =
        message_of(ErrorKind::kStorage, [&] { const Transaction blocked(second); });
    EXPECT_THAT(message, HasSubstr("in use by another process"));
    EXPECT_THAT(message, HasSubstr(path().string()));
  }
  const Transaction free(second);
}

TEST_F(SqliteTest, StopsWhenAsked) {
  std::stop_source stop;
  Database database(path(), {.access = Access::kCreate, .stop = stop.get_token()});
  std::jthread later([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    stop.request_stop();
  });
  message_of(ErrorKind::kCancelled, [&] {
    database.integer(
        "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT count(*) FROM n");
  });
}

// Whatever one byte of a file becomes: a value, or an Error that names the file.
TEST_F(SqliteTest, SurvivesEveryFlippedByte) {
  {
    Database database = fresh("sound.db");
    database.execute(
        "PRAGMA page_size = 512; CREATE TABLE t (id INTEGER PRIMARY KEY, s TEXT, b BLOB)");
    Statement insert = database.prepare("INSERT INTO t VALUES (?1, ?2, ?3)");
    const std::vector<std::byte> blob = bytes_of(std::string(700, 'b'));
    for (int i = 0; i < 8; ++i) insert.run(i, "some text", std::span<const std::byte>(blob));
  }
  const std::string sound = read_file(path("sound.db"));
  std::filesystem::copy_file(path("sound.db"), path("damaged.db"));
  std::fstream file(path("damaged.db"), std::ios::binary | std::ios::in | std::ios::out);
  const auto put = [&](std::size_t at, char byte) {
    file.seekp(static_cast<std::streamoff>(at));
    file.put(byte).flush();
  };
  int refused = 0;
  for (std::size_t at = 0; at < sound.size(); at += at < 1100 ? 1 : 13) {
    for (const int mask : {0x01, 0x80, 0xff}) {
      put(at, static_cast<char>(sound[at] ^ mask));
      try {
        Database database(path("damaged.db"), {.immutable = true});
        Statement rows = database.prepare("SELECT id, s, b FROM t");
        std::size_t bytes = 0;
        while (rows.step()) {
          bytes += rows.optional_text(1).value_or("").size();
          if (rows.type(2) == ColumnType::kBlob) bytes += rows.blob(2).size();
        }
        EXPECT_LE(bytes, 100 * sound.size());
      } catch (const Error& error) {
        ++refused;
        EXPECT_NE(error.kind(), ErrorKind::kMisuse) << error.what();
        EXPECT_THAT(error.what(), HasSubstr("damaged.db"));
      }
    }
    put(at, sound[at]);
  }
  EXPECT_GT(refused, 100);
}

// SQLite's number of pages of such a row overflows, and it is "out of memory".
TEST_F(SqliteTest, CallsAFileDamagedInWhichARowClaimsGigabytes) {
  {
    Database database = fresh();
    // The row of the schema goes on in other pages.
    database.execute("CREATE TABLE " + std::string(3'000, 't') + " (a)");
  }
  std::string bytes = read_file(path());
  const auto at = [&bytes](std::size_t i) { return static_cast<std::uint8_t>(bytes.at(i)); };
  // The first row of page 1 begins with its length in bytes of 7 bits, behind free space; see "B-tree Pages" of
  // SQLite's file format.
  constexpr std::size_t kRows = 108;
  const std::size_t row = at(kRows) * 256U + at(kRows + 1);
  std::size_t length = 1;
  while (at(row + length - 1) >= 0x80) ++length;
  constexpr std::uint64_t kClaimed = 0xffff'ffff;
  const std::size_t start = row + length - 5;
  for (std::size_t i = 0; i < 5; ++i) {
    bytes.at(start + i) =
        static_cast<char>((kClaimed >> (7 * (4 - i)) & 0x7fU) | (i < 4 ? 0x80U : 0U));
  }
  bytes.at(kRows) = static_cast<char>(start / 256);
  bytes.at(kRows + 1) = static_cast<char>(start % 256);
  std::ofstream(path(), std::ios::binary) << bytes;
  EXPECT_THAT(message_of(ErrorKind::kInput, [&] { Database(path(), {}).has_table("t"); }),
              HasSubstr("damaged"));
}

TEST_F(SqliteTest, MakesNoValueThatIsLongerThanAnUntrustedFileCanHold) {
  fresh().execute("CREATE TABLE t (b)");
  const auto make = [&](const OpenOptions& options) {
    Database database(path(), options);
    Statement row = database.prepare("SELECT zeroblob(1000000)");
    row.step();
    return row.blob(0).size();
  };
  EXPECT_THAT(message_of(ErrorKind::kInput, [&] { make({}); }), HasSubstr("too big"));
  EXPECT_THAT(message_of(ErrorKind::kInput,
                         [&] { make({.access = Access::kWrite, .longest_written = 1000}); }),
              HasSubstr("too big"));
  EXPECT_EQ(make({.access = Access::kWrite, .longest_written = 1'000'000}), 1'000'000U);
  EXPECT_EQ(make({.access = Access::kWrite}), 1'000'000U);
  // A reader beside a writer.
  EXPECT_EQ(make({.longest_written = 1'000'000}), 1'000'000U);
}

TEST_F(SqliteTest, RefusesAFileCutShort) {
  {
    Database database = fresh("sound.db");
    database.execute("CREATE TABLE t (b)");
    database.run("INSERT INTO t VALUES (zeroblob(?1))", 50'000);
  }
  const std::string sound = read_file(path("sound.db"));
  std::ofstream(path("cut.db"), std::ios::binary) << sound.substr(0, sound.size() / 2);
  const std::string message = message_of(ErrorKind::kInput, [&] {
    Database database(path("cut.db"));
    Statement rows = database.prepare("SELECT b FROM t");
    while (rows.step()) rows.blob(0);
  });
  EXPECT_THAT(message, HasSubstr("damaged"));
}

}  // namespace
}  // namespace cairn::sqlite
