// SPDX-License-Identifier: BSD-3-Clause
#include <utility>

#include <fmt/format.h>

#include "cairn/atlas/detail/sql_store.hpp"
#include "cairn/atlas/detail/stores.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/text.hpp"
#include "cairn/storage/postgres/database.hpp"

namespace cairn::detail {
namespace {

// The tables of docs/formats.md in PostgreSQL's types, the number of their schema, and the queue.
constexpr const char* kTables = R"sql(
CREATE SCHEMA cairn;
CREATE TABLE cairn.atlas (schema BIGINT NOT NULL);
CREATE TABLE cairn.commits (
  id BIGINT PRIMARY KEY, time_ms BIGINT NOT NULL, author TEXT NOT NULL, host TEXT NOT NULL,
  verb TEXT NOT NULL, text TEXT NOT NULL, undoes BIGINT, run BIGINT NOT NULL, digest BYTEA NOT NULL
);
CREATE TABLE cairn.changes (
  commit_id BIGINT NOT NULL, number BIGINT NOT NULL, kind BIGINT NOT NULL,
  object BIGINT NOT NULL, value BIGINT, PRIMARY KEY (commit_id, number)
);
CREATE TABLE cairn.maps (
  id BIGINT GENERATED ALWAYS AS IDENTITY PRIMARY KEY, hash BYTEA NOT NULL UNIQUE, bytes BIGINT NOT NULL
);
CREATE TABLE cairn.map_chunks (
  map BIGINT NOT NULL, number BIGINT NOT NULL, bytes BYTEA NOT NULL, PRIMARY KEY (map, number)
);
CREATE TABLE cairn.nodes (
  id BIGINT PRIMARY KEY, name TEXT NOT NULL, session TEXT NOT NULL, map BYTEA NOT NULL,
  length_unit BIGINT NOT NULL, frames BIGINT NOT NULL, landmarks BIGINT NOT NULL,
  observations BIGINT NOT NULL, extent BYTEA NOT NULL, digest BYTEA NOT NULL
);
CREATE TABLE cairn.links (
  id BIGINT PRIMARY KEY, target BIGINT NOT NULL, source BIGINT NOT NULL, kind BIGINT NOT NULL,
  verdict BIGINT NOT NULL, probability DOUBLE PRECISION, reason TEXT NOT NULL,
  target_from_source BYTEA, covariance BYTEA, covariance_with_scale BYTEA, digest BYTEA NOT NULL
);
CREATE TABLE cairn.poses (
  id BIGINT PRIMARY KEY, node BIGINT NOT NULL, frame BIGINT NOT NULL,
  frame_from_node BYTEA NOT NULL, covariance BYTEA NOT NULL, digest BYTEA NOT NULL
);
CREATE TABLE cairn.pair_queue (
  target BIGINT NOT NULL, source BIGINT NOT NULL, PRIMARY KEY (target, source)
);
-- Maps are compressed badly, and read whole.
ALTER TABLE cairn.map_chunks ALTER COLUMN bytes SET STORAGE EXTERNAL;
)sql";

postgres::OpenOptions connection_options(const AtlasStoreOptions& options) {
  return {.read_only = options.read_only,
          .lock_timeout = options.wait,
          .stop = options.stop,
          .schema = "cairn"};
}

postgres::Database connect(const std::string& url, const AtlasStoreOptions& options) {
  postgres::Database database(url, without_password(url), connection_options(options));
  if (!options.insist && database.text("SELECT current_setting('fsync')") != "on") {
    throw Error(ErrorKind::kStorage, database.name(),
                "its server does not wait until changes are on disk (fsync is off)",
                "a server that does; --insist if you are sure");
  }
  return database;
}

bool has_atlas(postgres::Database& database) {
  return database.integer(
             "SELECT count(*) FROM information_schema.tables "
             "WHERE table_schema = 'cairn' AND table_name = 'atlas'") > 0;
}

class PostgresPairQueue final : public AtlasPairQueue {
 public:
  explicit PostgresPairQueue(postgres::Database database) : database_(std::move(database)) {}

  void add(std::span<const NodePair> pairs) {
    postgres::Transaction transaction(database_, postgres::Transaction::Kind::kRows);
    postgres::Statement insert = database_.prepare(
        "INSERT INTO pair_queue (target, source) VALUES (?1, ?2) ON CONFLICT DO NOTHING");
    for (const auto& [target, source] : pairs) insert.run(target.value, source.value);
    transaction.commit();
  }

  std::vector<NodePair> take(std::size_t count) override {
    // The rows stay locked until done(), or until this connection ends, however it ends.
    taken_.clear();
    transaction_.reset();
    transaction_.emplace(database_, postgres::Transaction::Kind::kRows);
    postgres::Statement rows = database_.prepare(
        "SELECT target, source FROM pair_queue ORDER BY source, target LIMIT ?1 "
        "FOR UPDATE SKIP LOCKED");
    rows.bind_all(count);
    while (rows.step()) {
      taken_.emplace_back(NodeId{rows.unsigned_integer(0)}, NodeId{rows.unsigned_integer(1)});
    }
    return taken_;
  }

  void done() override {
    postgres::Statement remove =
        database_.prepare("DELETE FROM pair_queue WHERE target = ?1 AND source = ?2");
    for (const auto& [target, source] : taken_) remove.run(target.value, source.value);
    transaction_->commit();
    transaction_.reset();
    taken_.clear();
  }

 private:
  postgres::Database database_;
  std::optional<postgres::Transaction> transaction_;
  std::vector<NodePair> taken_;
};

class PostgresStore final : public SqlStore {
 public:
  PostgresStore(postgres::Database database, std::string url, const AtlasStoreOptions& options)
      : SqlStore(std::move(database), options), url_(std::move(url)) {}

  std::unique_ptr<AtlasPairQueue> share(std::span<const NodePair> pairs) override {
    // A separate connection, because taken rows stay locked while links are committed.
    auto queue = std::make_unique<PostgresPairQueue>(connect(url_, options()));
    queue->add(pairs);
    return queue;
  }

 private:
  std::string url_;
};

}  // namespace

void create_postgres_store(const std::string& url, const AtlasStoreOptions& options) {
  postgres::Database database = connect(url, options);
  postgres::Transaction transaction(database);
  refuse_if(has_atlas(database), database.name(), "holds an atlas already",
            "a database without one");
  database.execute(kTables);
  database.run("INSERT INTO atlas VALUES (?1)", kAtlasSchema);
  transaction.commit();
}

std::unique_ptr<AtlasStore> open_postgres_store(const std::string& url,
                                                const AtlasStoreOptions& options) {
  postgres::Database database = connect(url, options);
  if (!has_atlas(database)) {
    throw Error(ErrorKind::kInput, database.name(), "holds no atlas",
                "an atlas; 'cairn atlas init' makes one");
  }
  const std::int64_t schema = database.integer("SELECT schema FROM atlas");
  reject_if(schema != kAtlasSchema, database.name(), fmt::format("an atlas of schema {}", schema),
            fmt::format("schema {}: another version of cairn wrote it", kAtlasSchema));
  return std::make_unique<PostgresStore>(std::move(database), url, options);
}

}  // namespace cairn::detail
