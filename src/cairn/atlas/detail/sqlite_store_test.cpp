// SPDX-License-Identifier: BSD-3-Clause
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <set>
#include <string>

#include <fcntl.h>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <unistd.h>

#include "cairn/atlas/detail/stores.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"
#include "cairn/storage/sqlite/database.hpp"

#include "support/atlas_records.hpp"
#include "support/temporary_folder.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

using testing::add;
using testing::add_link;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::link;
using testing::message_of;

class SqliteStoreTest : public ::testing::Test {
 protected:
  void SetUp() override { create_store(path()); }

  fs::path path() const { return folder_ / "town.atlas"; }
  std::unique_ptr<AtlasStore> open(AtlasStoreOptions options = {}) const {
    if (options.author.empty()) options.author = "ada";
    return open_store(path(), options);
  }

  // Changes a table behind the store's back.
  void tamper(const std::string& sql) const {
    sqlite::Database database(path(), {.access = sqlite::Access::kWrite});
    database.execute(sql);
  }

  testing::TemporaryFolder folder_;
};

TEST_F(SqliteStoreTest, TakesOverWhatAKilledProcessLeftUnfinished) {
  folder_.write(".new.atlas.cairn-unfinished", "half of an atlas");
  folder_.write(".new.atlas.cairn-unfinished-wal", "and of its log");
  create_store(folder_ / "new.atlas");
  EXPECT_THAT(open_store(folder_ / "new.atlas", {})->verify().problems, IsEmpty());
  std::set<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder_.path())) {
    names.insert(entry.path().filename());
  }
  EXPECT_THAT(names, ElementsAre("new.atlas", "town.atlas"));
}

// SQLite would read an old atlas out of it.
TEST_F(SqliteStoreTest, IsNotMadeBesideWhatAnotherLeft) {
  for (const std::string ending : {"-wal", "-journal"}) {
    folder_.write("new.atlas" + ending, "left");
    for (const auto& make :
         {std::function<void()>([&] { create_store(folder_ / "new.atlas"); }),
          std::function<void()>([&] { salvage_store(path(), folder_ / "new.atlas"); })}) {
      EXPECT_THAT(message_of(ErrorKind::kStorage, make), HasSubstr("new.atlas" + ending));
    }
    EXPECT_FALSE(fs::exists(folder_ / "new.atlas"));
    fs::remove(folder_ / ("new.atlas" + ending));
  }
  fs::create_symlink(folder_.write("empty", ""), folder_ / "new.atlas-wal");
  EXPECT_THAT(message_of(ErrorKind::kStorage, [&] { create_store(folder_ / "new.atlas"); }),
              HasSubstr("new.atlas-wal"));
  fs::remove(folder_ / "new.atlas-wal");
  create_store(folder_ / "new.atlas");
}

TEST_F(SqliteStoreTest, IsMadeAgainAfterItWasReadAndDeleted) {
  open({.read_only = true})->state();
  fs::remove(path());
  create_store(path());
  EXPECT_TRUE(open()->state().nodes.empty());
}

TEST_F(SqliteStoreTest, ReadsMapsThatAnotherProcessAddsMeanwhile) {
  const auto reader = open({.read_only = true});
  const std::string bytes(std::size_t{3} << 20, 'm');
  const auto writer = open();
  const std::string map = writer->put_map(bytes);
  EXPECT_EQ(reader->map_bytes(map), bytes);
}

TEST_F(SqliteStoreTest, SalvagesAnAtlasThatLacksATable) {
  add(*open(), "one", 1);
  tamper("DROP TABLE poses");
  EXPECT_THAT(message_of(ErrorKind::kInput, [&] { open(); }),
              AllOf(HasSubstr("table poses"), HasSubstr("salvage")));
  const AtlasSalvage salvage = salvage_store(path(), folder_ / "saved");
  EXPECT_EQ(salvage.maps, 1U);
  EXPECT_THAT(salvage.lost, Contains(HasSubstr("poses")));
}

// A process that is killed between the two leaves an atlas with a second name, which is no rest to write over.
TEST_F(SqliteStoreTest, LeavesAnAtlasAloneThatHasTheUnfinishedNameToo) {
  fs::create_hard_link(path(), folder_ / ".new.atlas.cairn-unfinished");
  const std::string before = testing::read_text(path());
  create_store(folder_ / "new.atlas");
  EXPECT_EQ(testing::read_text(path()), before);
  EXPECT_FALSE(fs::exists(folder_ / ".new.atlas.cairn-unfinished"));
}

TEST_F(SqliteStoreTest, LosesItsSecondNameWhenItIsNextOpenedForWriting) {
  const fs::path second = folder_ / ".town.atlas.cairn-unfinished";
  fs::create_hard_link(path(), second);
  open_store(path(), {.read_only = true});
  EXPECT_TRUE(fs::exists(second));
  EXPECT_THAT(open_store(path(), {})->verify().problems, IsEmpty());
  EXPECT_FALSE(fs::exists(second));
  // Another file of that name may be one that a process is just making.
  folder_.write(second.filename().string(), "half of an atlas");
  open_store(path(), {});
  EXPECT_TRUE(fs::exists(second));
}

TEST_F(SqliteStoreTest, IsNotMadeByTwoProcessesAtOnce) {
  folder_.write(".new.atlas.cairn-unfinished", "");
  const int other = ::open((folder_ / ".new.atlas.cairn-unfinished").c_str(), O_RDWR | O_CLOEXEC);
  ASSERT_EQ(::flock(other, LOCK_EX), 0);
  EXPECT_THAT(message_of(ErrorKind::kStorage, [&] { create_store(folder_ / "new.atlas"); }),
              HasSubstr("new.atlas: another process is making it"));
  EXPECT_TRUE(fs::exists(folder_ / ".new.atlas.cairn-unfinished"));
  ::close(other);
  create_store(folder_ / "new.atlas");
  EXPECT_FALSE(fs::exists(folder_ / ".new.atlas.cairn-unfinished"));
}

TEST_F(SqliteStoreTest, IsToldFromOtherFiles) {
  EXPECT_TRUE(is_atlas_file(path()));
  EXPECT_FALSE(is_atlas_file(folder_ / "nothing.atlas"));
  EXPECT_FALSE(is_atlas_file(folder_.path()));
  folder_.write("short.atlas", "SQLite format 3");
  EXPECT_FALSE(is_atlas_file(folder_ / "short.atlas"));
  // A database of somebody else's.
  std::string bytes = testing::read_text(path());
  bytes[68] = 0;
  folder_.write("other.atlas", bytes);
  EXPECT_FALSE(is_atlas_file(folder_ / "other.atlas"));
}

TEST_F(SqliteStoreTest, SaysThatAnotherProcessWrites) {
  const auto store = open({.wait = std::chrono::milliseconds(10)});
  sqlite::Database other(path(), {.access = sqlite::Access::kWrite});
  const sqlite::Transaction writing(other);
  EXPECT_THAT(message_of(ErrorKind::kStorage, [&] { add(*store, "one", 1); }),
              HasSubstr("in use by another process"));
}

TEST_F(SqliteStoreTest, RefusesWhatIsNoAtlasOrANewerOne) {
  EXPECT_THAT(message_of(ErrorKind::kMisuse, [&] { create_store(path()); }),
              HasSubstr("exists already"));
  EXPECT_THAT(message_of(ErrorKind::kInput, [&] { open_store(folder_ / "none"); }),
              HasSubstr("no such file"));
  folder_.write("text", "not a database, but long enough to look at; " + std::string(200, '.'));
  EXPECT_THAT(message_of(ErrorKind::kInput, [&] { open_store(folder_ / "text"); }),
              HasSubstr("no SQLite database"));
  sqlite::Database(folder_ / "other", {.access = sqlite::Access::kCreate})
      .execute("CREATE TABLE t (i)");
  EXPECT_THAT(message_of(ErrorKind::kInput, [&] { open_store(folder_ / "other"); }),
              HasSubstr("no atlas"));
  for (const int schema : {7, 0, -1}) {
    tamper(fmt::format("PRAGMA user_version = {}", schema));
    EXPECT_THAT(message_of(ErrorKind::kInput, [&] { open(); }),
                AllOf(HasSubstr(fmt::format("an atlas of schema {};", schema)),
                      HasSubstr("newer version")));
  }
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_.path()), fs::directory_iterator()), 3);
}

// A rollback journal can name any file as its super-journal, which SQLite then deletes.
TEST_F(SqliteStoreTest, NeverAppliesARollbackJournal) {
  add(*open(), "one", 1);
  folder_.write("mine.txt", "years of work");
  const std::string victim = (folder_ / "mine.txt").string();
  const auto number = [](std::uint32_t value) {
    std::string bytes;
    for (int shift = 24; shift >= 0; shift -= 8) bytes += static_cast<char>(value >> shift);
    return bytes;
  };
  const std::string magic("\xd9\xd5\x05\xf9\x20\xa1\x63\xd7", 8);
  std::string journal = magic + number(0) + number(0) + number(2) + number(512) + number(4096);
  journal.resize(512, '\0');
  std::uint32_t checksum = 0;
  for (const char c : victim) checksum += static_cast<unsigned char>(c);
  journal += number(0x40000000 / 4096 + 1) + victim +
             number(static_cast<std::uint32_t>(victim.size())) + number(checksum) + magic;
  folder_.write("town.atlas-journal", journal);
  fs::create_symlink(path(), folder_ / "link.atlas");
  for (const char* const name : {"town.atlas", "link.atlas"}) {
    for (const bool read_only : {true, false}) {
      EXPECT_THAT(message_of(ErrorKind::kInput,
                             [&] { open_store(folder_ / name, {.read_only = read_only}); }),
                  HasSubstr("town.atlas-journal"));
    }
  }
  EXPECT_THAT(
      message_of(ErrorKind::kInput, [&] { salvage_store(path(), folder_ / "saved.atlas"); }),
      HasSubstr("town.atlas-journal"));
  EXPECT_TRUE(fs::exists(victim));
  folder_.write("town.atlas-journal", "");
  EXPECT_EQ(open()->state().nodes.size(), 1U);
}

// A generated column, for example, can be of any length in a small file.
TEST_F(SqliteStoreTest, RefusesTablesThatAreNotItsOwn) {
  const std::string sound = testing::read_text(path());
  for (const auto& [sql, reason] :
       {std::pair("ALTER TABLE nodes ADD COLUMN long TEXT AS (hex(zeroblob(id)))", "'nodes'"),
        std::pair("CREATE TABLE other (i)", "'other'"),
        std::pair("CREATE INDEX fast ON nodes (hex(name))", "'fast'"),
        std::pair("CREATE VIEW v AS SELECT 1", "'v'"),
        std::pair("ALTER TABLE links RENAME TO ways", "'ways'")}) {
    tamper(sql);
    for (const bool read_only : {true, false}) {
      EXPECT_THAT(message_of(ErrorKind::kInput, [&] { open({.read_only = read_only}); }),
                  HasSubstr(reason))
          << sql;
    }
    EXPECT_THAT(
        message_of(ErrorKind::kInput, [&] { salvage_store(path(), folder_ / "saved.atlas"); }),
        HasSubstr(reason));
    folder_.write("town.atlas", sound);
  }
  EXPECT_THAT(open()->verify().problems, IsEmpty());
}

// Such as the copy that VACUUM INTO makes.
TEST_F(SqliteStoreTest, GivesACopyWithoutAWriteAheadLogOneBeforeItWrites) {
  add(*open(), "one", 1);
  sqlite::Database(path(), {.access = sqlite::Access::kWrite}).text("PRAGMA journal_mode = DELETE");
  const auto store = open();
  EXPECT_EQ(sqlite::Database(path()).text("PRAGMA journal_mode"), "wal");
  add(*store, "two", 2);
  EXPECT_EQ(store->state().nodes.size(), 2U);
}

TEST_F(SqliteStoreTest, SalvagesWhatIsSound) {
  {
    const auto store = open();
    for (int i = 1; i <= 3; ++i) add(*store, std::to_string(i), static_cast<std::uint64_t>(i));
    add_link(*store, link(NodeId{1}, NodeId{2}));
    add_link(*store, link(NodeId{1}, NodeId{3}));
    store->commit({.verb = "optimize"}, [](const AtlasState&) {
      AtlasChanges changes;
      for (const std::uint64_t id : {1, 2, 3}) {
        AtlasPose pose;
        pose.node = NodeId{id};
        pose.frame = NodeId{1};
        changes.poses.push_back(pose);
      }
      changes.agrees = {{LinkId{1}, true}, {LinkId{2}, false}};
      return changes;
    });
  }
  tamper("UPDATE map_chunks SET bytes = x'00' WHERE map = 2");
  const AtlasSalvage salvage = salvage_store(path(), folder_ / "saved");
  EXPECT_EQ(salvage.maps, 2U);
  EXPECT_EQ(salvage.links, 1U);
  EXPECT_EQ(salvage.poses, 2U);
  EXPECT_THAT(salvage.lost, ElementsAre(HasSubstr("nodes 2")));
  const auto saved = open_store(folder_ / "saved");
  EXPECT_THAT(saved->verify().problems, IsEmpty());
  const AtlasState state = saved->state();
  EXPECT_EQ(state.nodes.at(state.links.begin()->second.source).name, "3");
  EXPECT_FALSE(state.agrees.begin()->second);
}

TEST_F(SqliteStoreTest, SalvagedRowsNameMapsByTheirNewNumbers) {
  {
    const auto store = open();
    for (std::uint64_t i = 1; i <= 4; ++i) add(*store, std::to_string(i), i);
    add_link(*store, link(NodeId{3}, NodeId{4}));
    add_link(*store, link(NodeId{2}, NodeId{3}));
    store->commit({.verb = "optimize"}, [](const AtlasState&) {
      AtlasChanges changes;
      for (const auto& [id, frame] : {std::pair{2U, 2U}, {3U, 2U}, {4U, 4U}}) {
        AtlasPose pose;
        pose.node = NodeId{id};
        pose.frame = NodeId{frame};
        changes.poses.push_back(pose);
      }
      changes.agrees = {{LinkId{1}, false}};  // of the other it is not known
      return changes;
    });
  }
  tamper("DELETE FROM map_chunks WHERE map = 1");
  EXPECT_EQ(salvage_store(path(), folder_ / "saved").maps, 3U);
  const AtlasState state = open_store(folder_ / "saved")->state();
  const auto name_of = [&](NodeId id) { return state.nodes.at(id).name; };
  ASSERT_EQ(state.links.size(), 2U);
  const auto& [first, link] = *state.links.begin();
  EXPECT_EQ(name_of(link.target), "3");
  EXPECT_EQ(name_of(link.source), "4");
  EXPECT_EQ(state.agrees, (std::map<LinkId, bool>{{first, false}}));
  std::map<std::string, std::string> frames;
  for (const auto& [id, pose] : state.poses) frames[name_of(id)] = name_of(pose.frame);
  EXPECT_EQ(frames, (std::map<std::string, std::string>{{"2", "2"}, {"3", "2"}, {"4", "4"}}));
}

TEST_F(SqliteStoreTest, SalvagesNoMapThatCannotBeRead) {
  {
    const auto store = open();
    add(*store, "one", 1);
    AtlasNode wrong;
    wrong.name = "two";
    wrong.map = store->put_map("whole, but no map");
    store->commit({.verb = "add"}, [&](const AtlasState&) {
      AtlasChanges changes;
      changes.nodes = {wrong};
      return changes;
    });
  }
  const AtlasSalvage salvage = salvage_store(path(), folder_ / "saved");
  EXPECT_EQ(salvage.maps, 1U);
  EXPECT_THAT(salvage.lost, ElementsAre(HasSubstr("map two")));
}

TEST_F(SqliteStoreTest, TellsWhatSqliteFindsWrong) {
  add(*open(), "one", 1);
  {
    // The number of unused pages, of which there are none.
    std::fstream file(path(), std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(39).put(5);
  }
  EXPECT_THAT(open()->verify().problems, Contains(HasSubstr("town.atlas: ")));
}

TEST_F(SqliteStoreTest, IsMadeWithoutWhatAKilledProcessLeftInItsLog) {
  const auto other = open();
  add(*other, "of another atlas", 1);
  const std::string unfinished = (folder_ / ".new.atlas.cairn-unfinished").string();
  folder_.write(".new.atlas.cairn-unfinished", "");
  fs::copy(path().string() + "-wal", unfinished + "-wal");
  ASSERT_GT(fs::file_size(unfinished + "-wal"), 0U);
  create_store(folder_ / "new.atlas");
  EXPECT_TRUE(open_store(folder_ / "new.atlas")->state().nodes.empty());
}

TEST_F(SqliteStoreTest, CompactingGivesSpaceBack) {
  const auto store = open();
  for (std::uint64_t i = 1; i <= 20; ++i) add(*store, std::to_string(i), i);
  store->commit({.verb = "remove"}, [&](const AtlasState& now) {
    AtlasChanges changes;
    for (const auto& [id, node] : now.nodes) {
      if (id != NodeId{1}) changes.removed_nodes.push_back(id);
    }
    return changes;
  });
  store->compact(100, false);  // nothing to drop, but what waits beside the file comes into it
  const auto size = fs::file_size(path());
  EXPECT_EQ(store->compact(1, false).maps, 19U);
  EXPECT_LT(fs::file_size(path()), size);
}

TEST_F(SqliteStoreTest, SaysThatTheDiskIsFull) {
  const auto store = open();
  add(*store, "one", 1);
  sqlite::Database database(path(), {.access = sqlite::Access::kWrite});
  // As SQLite has it where no page can be added; the pragma is the connection's, so this one's own.
  database.execute(
      fmt::format("PRAGMA max_page_count = {}", database.integer("PRAGMA page_count")));
  sqlite::Transaction transaction(database);
  EXPECT_THAT(message_of(ErrorKind::kStorage,
                         [&] {
                           database.run("INSERT INTO maps (hash, bytes) VALUES (zeroblob(?1), 1)",
                                        1'000'000);
                         }),
              HasSubstr("no space is left"));
}

// Whatever byte is flipped: an Error, a problem that verify() tells, or the state as it was.
TEST_F(SqliteStoreTest, NeverSilentlyUsesFlippedBytes) {
  {
    const auto store = open();
    add(*store, "one", 1);
    add(*store, "two", 2);
    add_link(*store, link(NodeId{1}, NodeId{2}));
  }
  const auto told = [&](AtlasStore& store) {
    const AtlasState state = store.state();
    std::string text;
    for (const auto& [id, node] : state.nodes)
      text += node.name + node.map + store.map_bytes(node.map);
    for (const auto& [id, link] : state.links)
      text += link.reason + std::to_string(*link.probability);
    return text;
  };
  const std::string truth = told(*open());
  const std::string sound = read_file(path());
  std::fstream file(path(), std::ios::binary | std::ios::in | std::ios::out);
  const auto put = [&](std::size_t at, char byte) {
    file.seekp(static_cast<std::streamoff>(at));
    file.put(byte).flush();
  };
  int refused = 0;
  for (std::size_t at = 0; at < sound.size(); at += 97) {
    put(at, static_cast<char>(sound[at] ^ 0x10));
    try {
      // Only read: a write would change the file that is compared with.
      EXPECT_TRUE(told(*open({.read_only = true})) == truth) << "byte " << at;
    } catch (const Error& error) {
      ++refused;
      EXPECT_THAT(error.what(), HasSubstr("town.atlas"));
    }
    put(at, sound[at]);
  }
  EXPECT_GT(refused, 20);
}

TEST(NetworkFileSystem, IsKnownByItsType) {
  EXPECT_STREQ(detail::network_file_system(0x6969), "NFS");
  EXPECT_NE(detail::network_file_system(static_cast<long>(0xff534d42)), nullptr);
  EXPECT_EQ(detail::network_file_system(0xef53), nullptr);      // ext4
  EXPECT_EQ(detail::network_file_system(0x01021994), nullptr);  // tmpfs
}

}  // namespace
}  // namespace cairn
