// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/atlas/store/sqlite_store.hpp"

#include <filesystem>
#include <fstream>
#include <string>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"
#include "cairn/map/io/binary.hpp"
#include "cairn/map/synthetic.hpp"
#include "cairn/sqlite/database.hpp"

#include "support/temporary_folder.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

template <class Action>
std::string message_of(ErrorKind kind, const Action& action) {
  try {
    action();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), kind) << error.what();
    return error.what();
  }
  ADD_FAILURE() << "no Error";
  return {};
}

std::string bytes_of(const LandmarkMap& map) {
  std::string bytes;
  write_binary(map, [&](std::string_view more) { bytes += more; });
  return bytes;
}

class SqliteStoreTest : public ::testing::Test {
 protected:
  void SetUp() override { create_sqlite_store(path()); }

  fs::path path() const { return folder_ / "town.atlas"; }
  std::unique_ptr<AtlasStore> open(AtlasStoreOptions options = {}) const {
    if (options.author.empty()) options.author = "ada";
    return open_sqlite_store(path(), options);
  }

  static AtlasNode node(AtlasStore& store, const std::string& name, std::uint64_t seed) {
    AtlasNode node;
    node.name = name;
    node.map = store.put_map(bytes_of(synthetic_map({.seed = seed, .landmarks = 30, .frames = 4})));
    node.landmarks = 30;
    return node;
  }

  static AtlasCommitted add(AtlasStore& store, const std::string& name, std::uint64_t seed) {
    const AtlasNode added = node(store, name, seed);
    return store.commit({.verb = "add"}, [&](const AtlasState&) {
      AtlasChanges changes;
      changes.text = name;
      changes.nodes = {added};
      return changes;
    });
  }

  static AtlasLink link(NodeId target, NodeId source) {
    AtlasLink link;
    link.target = target;
    link.source = source;
    link.verdict = Verdict::kAligned;
    link.probability = 0.999;
    link.reason = "found";
    link.target_from_source =
        Similarity3(1.25, Rigid3::from_roll_pitch_yaw({0.1, -2.0, 3.0}, 0.3, 0.2, -0.1));
    link.covariance_with_scale = 1e-4 * Matrix7d::Identity();
    return link;
  }

  static AtlasCommitted add_link(AtlasStore& store, const AtlasLink& link) {
    return store.commit({.verb = "link"}, [&](const AtlasState&) {
      AtlasChanges changes;
      changes.links = {link};
      return changes;
    });
  }

  // Changes a table behind the store's back.
  void tamper(const std::string& sql) const {
    sqlite::Database database(path(), {.access = sqlite::Access::kWrite});
    database.execute(sql);
  }

  testing::TemporaryFolder folder_;
};

TEST_F(SqliteStoreTest, IsToldFromOtherFiles) {
  EXPECT_TRUE(is_sqlite_store(path()));
  EXPECT_FALSE(is_sqlite_store(folder_ / "nothing.atlas"));
  EXPECT_FALSE(is_sqlite_store(folder_.path()));
  folder_.write("short.atlas", "SQLite format 3");
  EXPECT_FALSE(is_sqlite_store(folder_ / "short.atlas"));
  // A database of somebody else's.
  std::string bytes = testing::read_text(path());
  bytes[68] = 0;
  folder_.write("other.atlas", bytes);
  EXPECT_FALSE(is_sqlite_store(folder_ / "other.atlas"));
}

TEST_F(SqliteStoreTest, GivesBackWhatWasCommitted) {
  const AtlasLink stored = link(NodeId{1}, NodeId{2});
  {
    const auto store = open();
    EXPECT_EQ(add(*store, "one", 1).nodes, std::vector{NodeId{1}});
    EXPECT_EQ(add(*store, "two", 2).nodes, std::vector{NodeId{2}});
    EXPECT_EQ(add_link(*store, stored).links, std::vector{AtlasLinkId{1}});
  }
  const auto store = open({.read_only = true});
  const AtlasState state = store->state();
  EXPECT_EQ(state.commit, CommitId{3});
  ASSERT_EQ(state.nodes.size(), 2U);
  EXPECT_EQ(state.nodes.at(NodeId{2}).name, "two");
  EXPECT_EQ(store->map_bytes(state.nodes.at(NodeId{2}).map),
            bytes_of(synthetic_map({.seed = 2, .landmarks = 30, .frames = 4})));
  const AtlasLink& found = state.links.at(AtlasLinkId{1});
  EXPECT_TRUE(
      found.target_from_source->matrix().isApprox(stored.target_from_source->matrix(), 1e-15));
  EXPECT_EQ(*found.covariance_with_scale, *stored.covariance_with_scale);
  EXPECT_FALSE(found.covariance.has_value());
  EXPECT_EQ(found.probability, 0.999);
  EXPECT_EQ(store->state(CommitId{1}).nodes.size(), 1U);
  EXPECT_TRUE(store->state(CommitId{0}).nodes.empty());
  const std::vector<AtlasCommit> log = store->log();
  ASSERT_EQ(log.size(), 3U);
  EXPECT_EQ(log[1].text, "two");
  EXPECT_EQ(log[1].author, "ada");
  EXPECT_EQ(log[1].run, CommitId{2});
  EXPECT_THAT(store->verify().problems, IsEmpty());
  EXPECT_THAT(message_of(ErrorKind::kMisuse, [&] { store->state(CommitId{4}); }),
              HasSubstr("commit 4"));
}

// Quaternions are normalised when they are read, which may change their last digit.
TEST_F(SqliteStoreTest, ReadsEveryRotationThatItWrote) {
  const auto store = open();
  add(*store, "one", 1);
  add(*store, "two", 2);
  store->commit({.verb = "link"}, [](const AtlasState&) {
    AtlasChanges changes;
    for (int i = 0; i < 200; ++i) {
      AtlasLink one = link(NodeId{1}, NodeId{2});
      one.target_from_source =
          Rigid3::from_roll_pitch_yaw({0.1 * i, 0, 0}, 0.03 * i, 0.01 * i, 1.7 * i);
      changes.links.push_back(one);
    }
    return changes;
  });
  const auto again = open();
  EXPECT_EQ(again->state().links.size(), 200U);
  EXPECT_THAT(again->verify().problems, IsEmpty());
}

TEST_F(SqliteStoreTest, KeepsMapsLongerThanAChunk) {
  const auto store = open();
  std::string bytes(9'000'001, 'x');
  for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<char>(i * 31 % 251);
  const std::string hash = store->put_map(bytes);
  EXPECT_EQ(store->put_map(bytes), hash);
  EXPECT_TRUE(store->map_bytes(hash) == bytes);
}

TEST_F(SqliteStoreTest, RefusesContradictionsAndChangesNothing) {
  const auto store = open();
  add(*store, "one", 1);
  EXPECT_THAT(message_of(ErrorKind::kMisuse, [&] { add(*store, "one", 2); }), HasSubstr("'one'"));
  message_of(ErrorKind::kMisuse, [&] { add_link(*store, link(NodeId{1}, NodeId{7})); });
  message_of(ErrorKind::kMisuse, [&] { add_link(*store, link(NodeId{1}, NodeId{1})); });
  AtlasLink broken = link(NodeId{1}, NodeId{1});
  (*broken.covariance_with_scale)(0, 0) = -1.0;
  message_of(ErrorKind::kMisuse, [&] { add_link(*store, broken); });
  EXPECT_EQ(store->last_commit(), CommitId{1});
  EXPECT_EQ(
      store->commit({.verb = "none"}, [](const AtlasState&) { return AtlasChanges(); }).commit,
      CommitId{1});
  EXPECT_THAT(store->verify().problems, IsEmpty());
}

TEST_F(SqliteStoreTest, SeesWhatAnotherProcessCommitted) {
  const auto first = open();
  const auto second = open();
  add(*first, "one", 1);
  add(*second, "two", 2);
  const AtlasCommitted third = add(*first, "three", 3);
  EXPECT_EQ(third.nodes, std::vector{NodeId{3}});
  EXPECT_EQ(second->state().nodes.size(), 3U);
}

TEST_F(SqliteStoreTest, SaysThatAnotherProcessWrites) {
  const auto store = open({.wait = std::chrono::milliseconds(10)});
  sqlite::Database other(path(), {.access = sqlite::Access::kWrite});
  const sqlite::Transaction writing(other);
  EXPECT_THAT(message_of(ErrorKind::kStorage, [&] { add(*store, "one", 1); }),
              HasSubstr("in use by another process"));
}

TEST_F(SqliteStoreTest, RefusesWhatIsNoAtlasOrANewerOne) {
  EXPECT_THAT(message_of(ErrorKind::kStorage, [&] { create_sqlite_store(path()); }),
              HasSubstr("exists already"));
  EXPECT_THAT(message_of(ErrorKind::kInput, [&] { open_sqlite_store(folder_ / "none"); }),
              HasSubstr("no such file"));
  folder_.write("text", "not a database, but long enough to look at; " + std::string(200, '.'));
  EXPECT_THAT(message_of(ErrorKind::kInput, [&] { open_sqlite_store(folder_ / "text"); }),
              HasSubstr("no SQLite database"));
  sqlite::Database(folder_ / "other", {.access = sqlite::Access::kCreate})
      .execute("CREATE TABLE t (i)");
  EXPECT_THAT(message_of(ErrorKind::kInput, [&] { open_sqlite_store(folder_ / "other"); }),
              HasSubstr("no atlas"));
  tamper("PRAGMA user_version = 7");
  EXPECT_THAT(message_of(ErrorKind::kInput, [&] { open(); }), HasSubstr("newer version"));
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_.path()), fs::directory_iterator()), 3);
}

TEST_F(SqliteStoreTest, NeverUsesARowThatWasChanged) {
  {
    const auto store = open();
    add(*store, "one", 1);
    add(*store, "two", 2);
    add_link(*store, link(NodeId{1}, NodeId{2}));
  }
  const std::string sound = read_file(path());
  const auto restore = [&] { std::ofstream(path(), std::ios::binary) << sound; };
  for (const std::string sql :
       {"UPDATE links SET probability = 0.5", "UPDATE links SET target_from_source = zeroblob(64)",
        "UPDATE nodes SET name = 'other' WHERE id = 2",
        "UPDATE commits SET author = 'eve' WHERE id = 1", "DELETE FROM changes WHERE commit_id = 2",
        "DELETE FROM commits WHERE id = 2", "DELETE FROM nodes WHERE id = 1"}) {
    tamper(sql);
    const auto store = open();
    EXPECT_THAT(message_of(ErrorKind::kInput, [&] { store->state(); }), HasSubstr("damaged"))
        << sql;
    EXPECT_FALSE(store->verify().problems.empty()) << sql;
    restore();
  }
  tamper("UPDATE map_chunks SET bytes = zeroblob(length(bytes))");
  const auto store = open();
  const AtlasState state = store->state();
  EXPECT_THAT(
      message_of(ErrorKind::kInput, [&] { store->map_bytes(state.nodes.at(NodeId{1}).map); }),
      HasSubstr("damaged"));
  EXPECT_EQ(store->verify().problems.size(), 2U);
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
      changes.agrees = {{AtlasLinkId{1}, true}, {AtlasLinkId{2}, false}};
      return changes;
    });
  }
  tamper("UPDATE map_chunks SET bytes = x'00' WHERE map = 2");
  const AtlasSalvage salvage = salvage_sqlite_store(path(), folder_ / "saved");
  EXPECT_EQ(salvage.maps, 2U);
  EXPECT_EQ(salvage.links, 1U);
  EXPECT_EQ(salvage.poses, 2U);
  EXPECT_THAT(salvage.lost, ElementsAre(HasSubstr("nodes 2")));
  const auto saved = open_sqlite_store(folder_ / "saved");
  EXPECT_THAT(saved->verify().problems, IsEmpty());
  const AtlasState state = saved->state();
  EXPECT_EQ(state.nodes.at(state.links.begin()->second.source).name, "3");
  EXPECT_FALSE(state.agrees.begin()->second);
}

TEST_F(SqliteStoreTest, CompactsWhatNoKeptCommitNeeds) {
  const auto store = open();
  add(*store, "one", 1);
  add(*store, "two", 2);
  const auto remove = [&](NodeId id) {
    store->commit({.verb = "remove"}, [&](const AtlasState&) {
      AtlasChanges changes;
      changes.removed_nodes = {id};
      return changes;
    });
  };
  remove(NodeId{1});
  add(*store, "three", 3);
  const AtlasCompaction dry = store->compact(1, true);
  EXPECT_EQ(dry.maps, 1U);
  EXPECT_EQ(dry.commits, 3U);
  EXPECT_EQ(store->state(CommitId{1}).nodes.size(), 1U);
  EXPECT_EQ(store->compact(3, false).maps, 0U);  // commit 2 is left, and needs it
  EXPECT_EQ(store->state(CommitId{2}).nodes.size(), 2U);
  EXPECT_THAT(message_of(ErrorKind::kMisuse, [&] { store->state(CommitId{1}); }),
              HasSubstr("compacted"));
  const auto size = fs::file_size(path());
  EXPECT_EQ(store->compact(1, false).maps, 1U);
  EXPECT_LT(fs::file_size(path()), size);
  EXPECT_THAT(store->verify().problems, IsEmpty());
  EXPECT_EQ(store->state().nodes.size(), 2U);
  EXPECT_EQ(add(*store, "four", 4).commit, CommitId{5});
  EXPECT_EQ(store->state().nodes.rbegin()->first, NodeId{4});
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
  EXPECT_STREQ(network_file_system(0x6969), "NFS");
  EXPECT_NE(network_file_system(static_cast<long>(0xff534d42)), nullptr);
  EXPECT_EQ(network_file_system(0xef53), nullptr);      // ext4
  EXPECT_EQ(network_file_system(0x01021994), nullptr);  // tmpfs
}

}  // namespace
}  // namespace cairn
