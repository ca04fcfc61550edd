// SPDX-License-Identifier: BSD-3-Clause
// What every store of an atlas does, wherever it keeps it.
#include "cairn/atlas/store/store.hpp"

#include <memory>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/atlas/detail/row_bytes.hpp"
#include "cairn/atlas/store/open_store.hpp"
#include "cairn/core/error.hpp"
#include "cairn/storage/sqlite/database.hpp"

#include "support/atlas_records.hpp"
#include "support/temporary_folder.hpp"
#ifdef CAIRN_HAS_POSTGRES
#include "cairn/storage/postgres/database.hpp"

#include "support/postgres_server.hpp"
#endif

namespace cairn {
namespace {

using testing::add;
using testing::add_link;
using testing::bytes_of;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::link;
using testing::message_of;

// Where one kind of store keeps atlases.
class Place {
 public:
  virtual ~Place() = default;
  // A location where no atlas is yet.
  virtual std::string fresh() = 0;
  // Changes the tables behind the store's back.
  virtual void tamper(const std::string& location, const std::string& sql) = 0;
};

class Files final : public Place {
 public:
  std::string fresh() override { return (folder_ / fmt::format("{}.atlas", number_++)).string(); }
  void tamper(const std::string& location, const std::string& sql) override {
    sqlite::Database(location, {.access = sqlite::Access::kWrite}).execute(sql);
  }

 private:
  testing::TemporaryFolder folder_;
  int number_ = 0;
};

#ifdef CAIRN_HAS_POSTGRES
class Server final : public Place {
 public:
  std::string fresh() override {
    const std::string name = fmt::format("atlas{}", number_++);
    postgres::Database(server_.url(), "server").execute("CREATE DATABASE " + name);
    return server_.url(name);
  }
  void tamper(const std::string& location, const std::string& sql) override {
    postgres::Database(location, location, {.schema = "cairn"}).execute(sql);
  }

 private:
  testing::PostgresServer server_;
  int number_ = 0;
};
#endif

class StoreTest : public ::testing::TestWithParam<std::string> {
 protected:
  void SetUp() override {
#ifdef CAIRN_HAS_POSTGRES
    if (GetParam() == "PostgreSQL") {
      if (const auto why = testing::PostgresServer::missing()) GTEST_SKIP() << *why;
      place_ = std::make_unique<Server>();
    }
#endif
    if (GetParam() == "SQLite") place_ = std::make_unique<Files>();
    renew();
  }

  // Another atlas, without maps.
  void renew() {
    location_ = place_->fresh();
    create_store(location_);
  }
  std::unique_ptr<AtlasStore> open(AtlasStoreOptions options = {}) const {
    if (options.author.empty()) options.author = "ada";
    return open_store(location_, options);
  }
  void tamper(const std::string& sql) { place_->tamper(location_, sql); }

  std::unique_ptr<Place> place_;
  std::string location_;
};

TEST_P(StoreTest, GivesBackWhatWasCommitted) {
  const Link stored = link(NodeId{1}, NodeId{2});
  {
    const auto store = open();
    EXPECT_EQ(add(*store, "one", 1).nodes, std::vector{NodeId{1}});
    EXPECT_EQ(add(*store, "two", 2).nodes, std::vector{NodeId{2}});
    EXPECT_EQ(add_link(*store, stored).links, std::vector{LinkId{1}});
  }
  const auto store = open({.read_only = true});
  const AtlasState state = store->state();
  EXPECT_EQ(state.commit, CommitId{3});
  ASSERT_EQ(state.nodes.size(), 2U);
  EXPECT_EQ(state.nodes.at(NodeId{2}).name, "two");
  EXPECT_EQ(store->map_bytes(state.nodes.at(NodeId{2}).map),
            bytes_of(synthetic_map({.seed = 2, .landmarks = 30, .frames = 4})));
  const Link& found = state.links.at(LinkId{1});
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
TEST_P(StoreTest, ReadsEveryRotationThatItWrote) {
  const auto store = open();
  add(*store, "one", 1);
  add(*store, "two", 2);
  store->commit({.verb = "link"}, [](const AtlasState&) {
    AtlasChanges changes;
    for (int i = 0; i < 200; ++i) {
      Link one = link(NodeId{1}, NodeId{2});
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

TEST_P(StoreTest, KeepsMapsLongerThanAChunk) {
  const auto store = open();
  std::string bytes;
  bytes.resize(9'000'001);
  for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<char>(i * 31 % 251);
  const std::string hash = store->put_map(bytes);
  EXPECT_EQ(store->put_map(bytes), hash);
  EXPECT_TRUE(store->map_bytes(hash) == bytes);
}

TEST_P(StoreTest, RefusesContradictionsAndChangesNothing) {
  const auto store = open();
  add(*store, "one", 1);
  EXPECT_THAT(message_of(ErrorKind::kMisuse, [&] { add(*store, "one", 2); }), HasSubstr("'one'"));
  message_of(ErrorKind::kMisuse, [&] { add_link(*store, link(NodeId{1}, NodeId{7})); });
  message_of(ErrorKind::kMisuse, [&] { add_link(*store, link(NodeId{1}, NodeId{1})); });
  Link broken = link(NodeId{1}, NodeId{1});
  (*broken.covariance_with_scale)(0, 0) = -1.0;
  message_of(ErrorKind::kMisuse, [&] { add_link(*store, broken); });
  AtlasNode never = testing::node(*store, "seven", 7);
  never.id = NodeId{7};
  EXPECT_THAT(message_of(ErrorKind::kMisuse,
                         [&] {
                           store->commit({.verb = "undo"}, [&](const AtlasState&) {
                             AtlasChanges changes;
                             changes.nodes = {never};
                             return changes;
                           });
                         }),
              HasSubstr("row 7"));
  EXPECT_EQ(store->last_commit(), CommitId{1});
  EXPECT_EQ(
      store->commit({.verb = "none"}, [](const AtlasState&) { return AtlasChanges(); }).commit,
      CommitId{1});
  EXPECT_THAT(store->verify().problems, IsEmpty());
}

TEST_P(StoreTest, ReadsAndPutsMapsWithinACommit) {
  const auto store = open();
  add(*store, "one", 1);
  const std::string bytes = bytes_of(synthetic_map({.seed = 2, .landmarks = 30, .frames = 4}));
  const auto add_two = [&](const AtlasState& now) {
    AtlasChanges changes;
    EXPECT_EQ(store->state().nodes.size(), now.nodes.size());
    EXPECT_EQ(store->state(CommitId{0}).nodes.size(), 0U);
    AtlasNode two = now.nodes.begin()->second;
    two.id = NodeId{};
    two.name = "two";
    two.map = store->put_map(bytes);
    EXPECT_EQ(store->map_bytes(two.map), bytes);
    changes.nodes = {two};
    return changes;
  };
  // What is not committed is not kept.
  store->commit({.verb = "add"}, [&](const AtlasState& now) {
    add_two(now);
    return AtlasChanges();
  });
  EXPECT_EQ(store->verify().maps, 1U);
  store->commit({.verb = "add"}, add_two);
  EXPECT_THAT(store->verify().problems, IsEmpty());
  EXPECT_EQ(store->verify().maps, 2U);
}

TEST_P(StoreTest, SeesWhatAnotherProcessCommitted) {
  const auto first = open();
  const auto second = open();
  add(*first, "one", 1);
  add(*second, "two", 2);
  const AtlasCommitted third = add(*first, "three", 3);
  EXPECT_EQ(third.nodes, std::vector{NodeId{3}});
  EXPECT_EQ(second->state().nodes.size(), 3U);
}

TEST_P(StoreTest, NeverUsesARowThatWasChanged) {
  for (const std::string sql :
       {"UPDATE links SET probability = 0.5", "UPDATE links SET target_from_source = digest",
        "UPDATE nodes SET name = 'other' WHERE id = 2",
        "UPDATE commits SET author = 'eve' WHERE id = 1", "DELETE FROM changes WHERE commit_id = 2",
        "DELETE FROM commits WHERE id = 2", "DELETE FROM commits WHERE id = 3",
        "DELETE FROM nodes WHERE id = 1"}) {
    renew();
    {
      const auto store = open();
      add(*store, "one", 1);
      add(*store, "two", 2);
      add_link(*store, link(NodeId{1}, NodeId{2}));
    }
    tamper(sql);
    const auto store = open();
    EXPECT_THAT(message_of(ErrorKind::kInput, [&] { store->state(); }), HasSubstr("damaged"))
        << sql;
    EXPECT_FALSE(store->verify().problems.empty()) << sql;
    const bool is_of_log =
        sql.find("commits") != std::string::npos || sql.find("changes") != std::string::npos;
    if (!is_of_log) continue;
    EXPECT_THAT(message_of(ErrorKind::kInput, [&] { store->log(); }), HasSubstr("damaged")) << sql;
    EXPECT_THAT(message_of(ErrorKind::kInput, [&] { add(*store, "three", 3); }),
                HasSubstr("damaged"))
        << sql;
  }
  renew();
  const auto store = open();
  add(*store, "one", 1);
  add(*store, "two", 2);
  tamper("UPDATE map_chunks SET bytes = (SELECT hash FROM maps WHERE id = 1)");
  const AtlasState state = store->state();
  EXPECT_THAT(
      message_of(ErrorKind::kInput, [&] { store->map_bytes(state.nodes.at(NodeId{1}).map); }),
      HasSubstr("damaged"));
  EXPECT_EQ(store->verify().problems.size(), 2U);
}

// As in a file that others made: every digest is right.
TEST_P(StoreTest, RefusesARowThatRefersToWhatIsNotThere) {
  Link stray = link(NodeId{1}, NodeId{2});
  {
    const auto store = open();
    add(*store, "one", 1);
    add(*store, "two", 2);
    add_link(*store, stray);
    stray = store->state().links.begin()->second;
  }
  stray.source = NodeId{99};
  const std::string digest = hexadecimal(digest_of(stray, blobs_of(stray)));
  tamper(fmt::format("UPDATE links SET source = 99, digest = {}{}'",
                     GetParam() == "SQLite" ? "x'" : "'\\x", digest));
  const auto store = open();
  EXPECT_THAT(message_of(ErrorKind::kInput, [&] { store->state(); }),
              HasSubstr("link 1 is of map 99, which is not there"));
  EXPECT_THAT(message_of(ErrorKind::kInput, [&] { add(*store, "three", 3); }),
              HasSubstr("link 1 is of map 99"));
  EXPECT_FALSE(store->verify().problems.empty());
}

TEST_P(StoreTest, CompactsWhatNoKeptCommitNeeds) {
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
  EXPECT_THAT(message_of(ErrorKind::kMisuse, [&] { store->compact(0, false); }),
              HasSubstr("at least 1 commit"));
  EXPECT_EQ(store->compact(1, false).maps, 1U);
  EXPECT_THAT(store->verify().problems, IsEmpty());
  EXPECT_EQ(store->state().nodes.size(), 2U);
  EXPECT_EQ(add(*store, "four", 4).commit, CommitId{5});
  EXPECT_EQ(store->state().nodes.rbegin()->first, NodeId{4});
}

TEST_P(StoreTest, NeverGivesAnIdAgainThatCompactingDropped) {
  const auto store = open();
  add(*store, "one", 1);
  add(*store, "two", 2);
  add(*store, "three", 3);
  add_link(*store, link(NodeId{1}, NodeId{2}));
  add_link(*store, link(NodeId{1}, NodeId{3}));
  store->commit({.verb = "remove"}, [](const AtlasState&) {
    AtlasChanges changes;
    changes.removed_nodes = {NodeId{3}};
    changes.removed_links = {LinkId{2}};
    return changes;
  });
  const std::string dropped = store->state(CommitId{3}).nodes.at(NodeId{3}).map;
  EXPECT_EQ(store->compact(1, false).nodes, 1U);
  EXPECT_THAT(message_of(ErrorKind::kStorage, [&] { store->map_bytes(dropped); }),
              HasSubstr("compacted"));
  // Compacted again, and again without anything to drop.
  EXPECT_EQ(add(*store, "four", 4).nodes, std::vector{NodeId{4}});
  store->commit({.verb = "remove"}, [](const AtlasState&) {
    AtlasChanges changes;
    changes.removed_nodes = {NodeId{4}};
    return changes;
  });
  store->compact(1, false);
  store->compact(1, false);
  EXPECT_EQ(add(*store, "five", 5).nodes, std::vector{NodeId{5}});
  EXPECT_EQ(add_link(*store, link(NodeId{1}, NodeId{5})).links, std::vector{LinkId{3}});
  EXPECT_EQ(store->compact(1, false).nodes, 0U);
  EXPECT_EQ(add(*store, "six", 6).nodes, std::vector{NodeId{6}});
  EXPECT_THAT(store->verify().problems, IsEmpty());
}

TEST_P(StoreTest, RefusesToMakeASecondOne) {
  add(*open(), "one", 1);
  message_of(ErrorKind::kMisuse, [&] { create_store(location_); });
  EXPECT_EQ(open()->state().nodes.size(), 1U);
}

std::vector<std::string> places() {
#ifdef CAIRN_HAS_POSTGRES
  return {"SQLite", "PostgreSQL"};
#else
  return {"SQLite"};
#endif
}

INSTANTIATE_TEST_SUITE_P(, StoreTest, ::testing::ValuesIn(places()),
                         [](const auto& place) { return place.param; });

}  // namespace
}  // namespace cairn
