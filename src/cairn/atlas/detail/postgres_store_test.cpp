// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/atlas/store/open_store.hpp"
#include "cairn/core/error.hpp"
#include "cairn/storage/postgres/database.hpp"

#include "support/atlas_records.hpp"
#include "support/postgres_server.hpp"

namespace cairn {
namespace {

using testing::add;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::message_of;
using ::testing::Not;

class PostgresStoreTest : public ::testing::Test {
 protected:
  void SetUp() override {
    if (const auto why = testing::PostgresServer::missing()) GTEST_SKIP() << *why;
    server_.emplace();
    create_store(server_->url());
  }

  std::unique_ptr<AtlasStore> open(const AtlasStoreOptions& options = {}) const {
    return open_store(server_->url(), options);
  }

  std::optional<testing::PostgresServer> server_;
};

TEST_F(PostgresStoreTest, SaysThatAnotherProcessWrites) {
  const auto store = open({.wait = std::chrono::milliseconds(10)});
  postgres::Database other(server_->url(), "other");
  {
    const postgres::Transaction writing(other);
    EXPECT_THAT(message_of(ErrorKind::kStorage, [&] { add(*store, "one", 1); }),
                HasSubstr("in use by another process"));
    // Who only reads does not wait.
    EXPECT_TRUE(open({.read_only = true, .wait = std::chrono::milliseconds(10)})->log().empty());
  }
  EXPECT_EQ(add(*store, "one", 1).commit, CommitId{1});
}

// As a server may have it for every connection.
TEST_F(PostgresStoreTest, ALimitOfTimeOfTheServerIsNoRequestToStop) {
  postgres::Database database(server_->url(), "server");
  database.execute("SET statement_timeout TO 1");
  EXPECT_THAT(message_of(ErrorKind::kStorage, [&] { database.execute("SELECT pg_sleep(10)"); }),
              HasSubstr("statement timeout"));
}

TEST(PostgresUrl, TellsNoPartOfAPassword) {
  for (const std::string password :
       {"top/secret", "0/secret", "top?secret", "top@secret", "top%zzsecret", "top secret"}) {
    const std::string url = "postgresql://ada:" + password + "@127.0.0.1:1/town";
    EXPECT_THAT(message_of(ErrorKind::kStorage, [&] { open_store(url, {}); }),
                AllOf(HasSubstr("no connection"), Not(HasSubstr("top")), Not(HasSubstr("port 0")),
                      Not(HasSubstr("secret"))));
  }
  EXPECT_THAT(message_of(ErrorKind::kStorage,
                         [] { open_store("postgresql://ada:se?cret@127.0.0.1:1/town"); }),
              HasSubstr("port 1 failed"));
}

TEST_F(PostgresStoreTest, WaitingEndsWhenAsked) {
  std::stop_source stop;
  const auto store = open({.stop = stop.get_token()});
  postgres::Database other(server_->url(), "other");
  const postgres::Transaction writing(other);
  stop.request_stop();
  message_of(ErrorKind::kCancelled, [&] { add(*store, "one", 1); });
}

TEST_F(PostgresStoreTest, KeepsWhatItAcknowledgedWhenTheServerIsKilled) {
  const auto store = open();
  for (std::uint64_t i = 1; i <= 5; ++i) add(*store, std::to_string(i), i);
  server_->crash();
  EXPECT_THAT(message_of(ErrorKind::kStorage, [&] { add(*store, "six", 6); }),
              HasSubstr("no connection"));
  const auto again = open();
  EXPECT_EQ(again->state().nodes.size(), 5U);
  EXPECT_THAT(again->verify().problems, IsEmpty());
  EXPECT_EQ(add(*again, "six", 6).nodes, std::vector{NodeId{6}});
}

TEST_F(PostgresStoreTest, APairIsGivenToOneProcessAndOfOneThatEndedToAnother) {
  const auto store = open();
  std::vector<NodePair> pairs;
  for (std::uint64_t source = 2; source <= 4; ++source) {
    for (std::uint64_t target = 1; target < source; ++target) {
      pairs.emplace_back(NodeId{target}, NodeId{source});
    }
  }
  const auto first = store->share(pairs);
  const auto second = open()->share(pairs);  // the same pairs: none is there twice
  const std::vector<NodePair> mine = first->take(4);
  EXPECT_EQ(mine.size(), 4U);
  {
    const auto third = open()->share({});
    EXPECT_EQ(third->take(10).size(), 2U);
    EXPECT_THAT(second->take(10), IsEmpty());
    // It ends here, and has not done them.
  }
  std::vector<NodePair> all = second->take(10);
  EXPECT_EQ(all.size(), 2U);
  second->done();
  first->done();
  EXPECT_THAT(first->take(10), IsEmpty());
  all.insert(all.end(), mine.begin(), mine.end());
  std::sort(all.begin(), all.end());
  std::sort(pairs.begin(), pairs.end());
  EXPECT_EQ(all, pairs);
}

TEST_F(PostgresStoreTest, RefusesWhatItCannotHold) {
  const auto store = open();
  using namespace std::string_literals;
  EXPECT_THAT(message_of(ErrorKind::kMisuse, [&] { add(*store, "a\0b"s, 1); }), HasSubstr("NUL"));
  EXPECT_THAT(message_of(ErrorKind::kMisuse, [&] { add(*store, "\xff", 1); }), HasSubstr("UTF-8"));
  EXPECT_EQ(store->last_commit(), CommitId{0});
  EXPECT_EQ(add(*store, "Łódź ?1 $1", 1).commit, CommitId{1});
  EXPECT_EQ(open()->state().nodes.at(NodeId{1}).name, "Łódź ?1 $1");
}

TEST_F(PostgresStoreTest, RefusesWhatIsNoAtlasOrOfAnotherSchema) {
  postgres::Database(server_->url(), "server").execute("CREATE DATABASE empty");
  EXPECT_THAT(message_of(ErrorKind::kInput, [&] { open_store(server_->url("empty")); }),
              HasSubstr("holds no atlas"));
  EXPECT_THAT(message_of(ErrorKind::kStorage, [&] { open_store(server_->url("none")); }),
              HasSubstr("none"));
  postgres::Database(server_->url(), "server", {.schema = "cairn"})
      .execute("UPDATE atlas SET schema = 7");
  EXPECT_THAT(message_of(ErrorKind::kInput, [&] { open(); }), HasSubstr("schema 7"));
}

TEST_F(PostgresStoreTest, WhoOnlyReadsCannotWrite) {
  const auto store = open({.read_only = true});
  EXPECT_THAT(message_of(ErrorKind::kStorage, [&] { add(*store, "one", 1); }),
              HasSubstr("cannot be written"));
}

TEST(PostgresServerTest, MustWaitForItsDisk) {
  if (const auto why = testing::PostgresServer::missing()) GTEST_SKIP() << *why;
  const testing::PostgresServer careless("fsync=off");
  EXPECT_THAT(message_of(ErrorKind::kStorage, [&] { create_store(careless.url()); }),
              HasSubstr("fsync is off"));
  create_store(careless.url(), {.insist = true});
}

TEST(PostgresServerTest, MustBeThere) {
  const std::string url = "postgresql://ada:secret@127.0.0.1:1/town?password=secret";
  const std::string message = message_of(ErrorKind::kStorage, [&] { open_store(url); });
  EXPECT_THAT(message, HasSubstr("no connection"));
  EXPECT_THAT(message, Not(HasSubstr("secret")));
}

}  // namespace
}  // namespace cairn
