// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/atlas/store/sqlite_store.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <limits>
#include <set>
#include <span>
#include <string_view>
#include <utility>

#include <fmt/format.h>
#include <sys/vfs.h>
#include <unistd.h>

#include "cairn/atlas/detail/row_bytes.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"
#include "cairn/core/hash.hpp"
#include "cairn/map/io/binary.hpp"
#include "cairn/sqlite/database.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

// "CRNA": tells an atlas from other SQLite files.
constexpr std::int64_t kApplicationId = 0x43524e41;

// SQLite's values end at 1 GB; smaller ones need less memory at a time.
constexpr std::size_t kChunkBytes = std::size_t{4} << 20;

// What the objects of changes are; the numbers are in files.
enum Kind : std::int64_t { kNode = 1, kLink = 2, kPose = 3, kAgrees = 4 };

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

std::span<const std::byte> as_blob(std::string_view bytes) {
  return std::as_bytes(std::span(bytes.data(), bytes.size()));
}

std::string_view as_text(std::span<const std::byte> blob) {
  return {reinterpret_cast<const char*>(blob.data()), blob.size()};
}

// A change as the table has it: after it, the object has the value, or is not there.
struct Change {
  std::int64_t kind = 0;
  std::uint64_t object = 0;
  std::optional<std::uint64_t> value;
};

std::string commit_digest(const AtlasCommit& commit, std::span<const Change> changes) {
  RowBytes row;
  row.add(commit.id.value).add(static_cast<std::uint64_t>(commit.time_ms));
  row.add(commit.author).add(commit.host).add(commit.verb).add(commit.text);
  row.add(commit.undoes ? std::optional(commit.undoes->value) : std::nullopt);
  row.add(commit.run.value);
  for (const Change& change : changes) {
    row.add(static_cast<std::uint64_t>(change.kind)).add(change.object).add(change.value);
  }
  return row.digest();
}

std::int64_t now_ms() {
  return std::chrono::duration_cast<std::chrono::milliseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

[[noreturn]] void damaged(const std::string& name, std::string_view what) {
  throw Error(ErrorKind::kInput, name, fmt::format("{} is damaged", what),
              "a sound atlas; 'cairn atlas salvage' takes what is sound into a new one");
}

constexpr const char* kNodeColumns =
    "id, name, session, map, length_unit, frames, landmarks, observations, extent, digest";
constexpr const char* kLinkColumns =
    "id, target, source, kind, verdict, probability, reason, target_from_source, covariance, "
    "covariance_with_scale, digest";
constexpr const char* kPoseColumns = "id, node, frame, frame_from_node, covariance, digest";

AtlasNode node_of(const sqlite::Statement& row, const std::string& name) {
  const auto what = [&] { return fmt::format("map {}", row.integer(0)); };
  AtlasNode node;
  node.id = NodeId{row.unsigned_integer(0)};
  node.name = row.text(1);
  node.session = row.text(2);
  node.map = hexadecimal(as_text(row.blob(3)));
  const std::int64_t unit = row.integer(4);
  if (unit != 0 && unit != 1) damaged(name, what());
  node.length_unit = unit == 0 ? LengthUnit::kMetres : LengthUnit::kFree;
  node.frames = row.unsigned_integer(5);
  node.landmarks = row.unsigned_integer(6);
  node.observations = row.unsigned_integer(7);
  const auto extent = extent_of_bytes(as_text(row.blob(8)));
  if (!extent) damaged(name, what());
  node.extent = *extent;
  if (as_text(row.blob(9)) != digest_of(node)) damaged(name, what());
  return node;
}

AtlasLink link_of(const sqlite::Statement& row, const std::string& name) {
  const auto what = [&] { return fmt::format("link {}", row.integer(0)); };
  AtlasLink link;
  link.id = AtlasLinkId{row.unsigned_integer(0)};
  link.target = NodeId{row.unsigned_integer(1)};
  link.source = NodeId{row.unsigned_integer(2)};
  const std::int64_t kind = row.integer(3);
  const std::int64_t verdict = row.integer(4);
  if (kind < 0 || kind > 2 || verdict < 0 || verdict > 2) damaged(name, what());
  link.kind = static_cast<LinkKind>(kind);
  link.verdict = static_cast<Verdict>(verdict);
  link.probability = row.optional_real(5);
  link.reason = row.text(6);
  const auto blob = [&](int column) {
    const auto bytes = row.optional_blob(column);
    return bytes ? std::string(as_text(*bytes)) : std::string();
  };
  const LinkBlobs blobs{blob(7), blob(8), blob(9)};
  if (as_text(row.blob(10)) != digest_of(link, blobs)) damaged(name, what());
  if (!blobs.target_from_source.empty()) {
    link.target_from_source = pose_of_bytes(blobs.target_from_source);
    if (!link.target_from_source) damaged(name, what());
  }
  if (!blobs.covariance.empty()) {
    link.covariance = covariance6_of_bytes(blobs.covariance);
    if (!link.covariance) damaged(name, what());
  }
  if (!blobs.covariance_with_scale.empty()) {
    link.covariance_with_scale = covariance7_of_bytes(blobs.covariance_with_scale);
    if (!link.covariance_with_scale) damaged(name, what());
  }
  return link;
}

AtlasPose pose_of(const sqlite::Statement& row, const std::string& name) {
  const auto what = [&] { return fmt::format("pose {}", row.integer(0)); };
  AtlasPose pose;
  pose.node = NodeId{row.unsigned_integer(1)};
  pose.frame = NodeId{row.unsigned_integer(2)};
  const PoseBlobs blobs{std::string(as_text(row.blob(3))), std::string(as_text(row.blob(4)))};
  const auto frame_from_node = pose_of_bytes(blobs.frame_from_node);
  const auto covariance = covariance7_of_bytes(blobs.covariance);
  if (!frame_from_node || !covariance ||
      as_text(row.blob(5)) != digest_of(pose, row.unsigned_integer(0), blobs)) {
    damaged(name, what());
  }
  pose.frame_from_node = *frame_from_node;
  pose.covariance = *covariance;
  return pose;
}

AtlasCommit commit_of(const sqlite::Statement& row) {
  AtlasCommit commit;
  commit.id = CommitId{row.unsigned_integer(0)};
  commit.time_ms = row.integer(1);
  commit.author = row.text(2);
  commit.host = row.text(3);
  commit.verb = row.text(4);
  commit.text = row.text(5);
  if (!row.is_null(6)) commit.undoes = CommitId{row.unsigned_integer(6)};
  commit.run = CommitId{row.unsigned_integer(7)};
  return commit;
}

constexpr const char* kCommitColumns = "id, time_ms, author, host, verb, text, undoes, run, digest";

// What every object's value is after some commits.
struct Values {
  std::map<std::uint64_t, std::uint64_t> nodes, links, poses, agrees;

  std::map<std::uint64_t, std::uint64_t>* of(std::int64_t kind) {
    switch (kind) {
      case kNode:
        return &nodes;
      case kLink:
        return &links;
      case kPose:
        return &poses;
      case kAgrees:
        return &agrees;
      default:
        return nullptr;
    }
  }
  bool apply(const Change& change) {
    auto* const values = of(change.kind);
    if (values == nullptr) return false;
    if (change.value) {
      (*values)[change.object] = *change.value;
    } else {
      values->erase(change.object);
    }
    return true;
  }
};

// Whether the changes lead to an atlas that can be.
void check_state(const AtlasState& state, const std::string& name) {
  const auto refuse = [&](const std::string& what, const std::string& expected) {
    throw Error(ErrorKind::kMisuse, name, what, expected);
  };
  std::set<std::string> names;
  for (const auto& [id, node] : state.nodes) {
    if (node.name.empty()) refuse(fmt::format("map {} has no name", id.value), "a name");
    if (!names.insert(node.name).second) {
      refuse(fmt::format("two maps called {}", printable(node.name)), "another name");
    }
  }
  for (const auto& [id, link] : state.links) {
    if (link.target == link.source) refuse("a link of a map with itself", "two maps");
    for (const NodeId end : {link.target, link.source}) {
      if (state.nodes.contains(end)) continue;
      refuse(fmt::format("link {} is of map {}, which is not there", id.value, end.value),
             "both maps of every link");
    }
  }
  for (const auto& [id, pose] : state.poses) {
    if (state.nodes.contains(id) && state.nodes.contains(pose.frame)) continue;
    refuse(fmt::format("the pose of map {} is of a map or in the frame of one that is not there",
                       id.value),
           "both maps");
  }
  for (const auto& [id, agrees] : state.agrees) {
    if (!state.links.contains(id)) refuse("agreement of a link that is not there", "the link");
  }
}

void apply(const AtlasChanges& changes, AtlasState& state) {
  for (const NodeId id : changes.removed_nodes) state.nodes.erase(id);
  for (const AtlasLinkId id : changes.removed_links) state.links.erase(id);
  for (const NodeId id : changes.removed_poses) state.poses.erase(id);
  for (const AtlasLinkId id : changes.removed_agrees) state.agrees.erase(id);
  for (const AtlasNode& node : changes.nodes) state.nodes[node.id] = node;
  for (const AtlasLink& link : changes.links) state.links[link.id] = link;
  for (const AtlasPose& pose : changes.poses) state.poses[pose.node] = pose;
  for (const auto& [id, agrees] : changes.agrees) state.agrees[id] = agrees;
}

class SqliteStore final : public AtlasStore {
 public:
  SqliteStore(sqlite::Database database, AtlasStoreOptions options)
      : database_(std::move(database)), options_(std::move(options)) {}

  const std::string& name() const override { return database_.name(); }

  CommitId last_commit() override {
    return CommitId{
        static_cast<std::uint64_t>(database_.integer("SELECT coalesce(max(id), 0) FROM commits"))};
  }

  AtlasState state(std::optional<CommitId> at) override {
    const sqlite::Transaction same(database_, sqlite::Transaction::Kind::kRead);
    const CommitId last = last_commit();
    if (at && *at > last) {
      throw Error(ErrorKind::kMisuse, name(), fmt::format("commit {}", at->value),
                  fmt::format("one of its commits, the last of which is {}", last.value));
    }
    if (at) {
      const auto first =
          static_cast<std::uint64_t>(database_.integer("SELECT coalesce(min(id), 0) FROM commits"));
      if (at->value < first && !(at->value == 0 && first <= 1)) {
        throw Error(ErrorKind::kMisuse, name(), fmt::format("commit {}", at->value),
                    fmt::format("commit {} or later: what was before is compacted", first));
      }
    }
    return read_state(at.value_or(last));
  }

  std::vector<AtlasCommit> log() override {
    std::vector<AtlasCommit> commits;
    sqlite::Statement rows =
        database_.prepare(fmt::format("SELECT {} FROM commits ORDER BY id", kCommitColumns));
    while (rows.step()) commits.push_back(commit_of(rows));
    return commits;
  }

  AtlasTouched touched(std::span<const CommitId> commits) override {
    AtlasTouched touched;
    std::set<std::pair<std::int64_t, std::uint64_t>> seen;
    sqlite::Statement rows =
        database_.prepare("SELECT kind, object FROM changes WHERE commit_id = ?1 ORDER BY number");
    for (const CommitId commit : commits) {
      rows.bind_all(commit.value);
      while (rows.step()) {
        const std::int64_t kind = rows.integer(0);
        const std::uint64_t object = rows.unsigned_integer(1);
        if (!seen.emplace(kind, object).second) continue;
        if (kind == kNode) touched.nodes.push_back(NodeId{object});
        if (kind == kLink) touched.links.push_back(AtlasLinkId{object});
        if (kind == kPose) touched.poses.push_back(NodeId{object});
        if (kind == kAgrees) touched.agrees.push_back(AtlasLinkId{object});
      }
    }
    return touched;
  }

  std::string put_map(std::string_view bytes) override {
    Hasher hasher;
    hasher.update(bytes);
    std::string hash = to_string(hasher.digest());
    const std::string key = *bytes_of_hexadecimal(hash);
    sqlite::Transaction transaction(database_);
    sqlite::Statement known = database_.prepare("SELECT id FROM maps WHERE hash = ?1");
    if (known.bind_all(as_blob(key)).step()) return hash;
    database_.run("INSERT INTO maps (hash, bytes) VALUES (?1, ?2)", as_blob(key), bytes.size());
    const std::int64_t map = database_.last_row_id();
    sqlite::Statement insert = database_.prepare("INSERT INTO map_chunks VALUES (?1, ?2, ?3)");
    for (std::size_t at = 0, number = 0; at < bytes.size(); at += kChunkBytes, ++number) {
      insert.run(map, number, as_blob(bytes.substr(at, kChunkBytes)));
    }
    transaction.commit();
    return hash;
  }

  std::string map_bytes(const std::string& hash) override {
    const std::string what = fmt::format("the stored map {}", hash);
    const auto key = bytes_of_hexadecimal(hash);
    sqlite::Statement row = database_.prepare("SELECT id, bytes FROM maps WHERE hash = ?1");
    if (!key || !row.bind_all(as_blob(*key)).step()) damaged(name(), what);
    const std::int64_t map = row.integer(0);
    const std::uint64_t size = row.unsigned_integer(1);
    sqlite::Statement chunks =
        database_.prepare("SELECT bytes FROM map_chunks WHERE map = ?1 ORDER BY number");
    chunks.bind_all(map);
    std::string bytes;
    while (chunks.step()) {
      const std::string_view chunk = as_text(chunks.blob(0));
      if (chunk.size() > size - bytes.size()) damaged(name(), what);
      bytes += chunk;
    }
    Hasher hasher;
    hasher.update(bytes);
    if (bytes.size() != size || to_string(hasher.digest()) != hash) damaged(name(), what);
    return bytes;
  }

  AtlasCommitted commit(const AtlasCommitInfo& info, const Make& make) override {
    sqlite::Transaction transaction(database_);
    const CommitId last = last_commit();
    if (!newest_ || newest_->commit != last) newest_ = read_state(last);
    AtlasChanges changes = make(*newest_);
    AtlasCommitted committed;
    committed.commit = last;
    if (changes.empty()) return committed;

    AtlasCommit commit;
    commit.id = CommitId{last.value + 1};
    commit.time_ms = now_ms();
    commit.author = options_.author;
    commit.host = options_.host;
    commit.verb = info.verb;
    commit.text = changes.text;
    commit.undoes = info.undoes;
    commit.run = info.run.value == 0 ? commit.id : info.run;
    const std::vector<Change> rows = write_objects(changes, committed);
    AtlasState next = *newest_;
    apply(changes, next);
    next.commit = commit.id;
    check_state(next, name());
    write_commit(commit, rows);
    transaction.commit();
    committed.commit = commit.id;
    newest_ = std::move(next);
    return committed;
  }

  AtlasVerification verify() override;
  AtlasCompaction compact(std::uint64_t keep, bool dry) override;

 private:
  // Of all commits up to this one, in their order; each commit's digest is checked.
  Values read_values(CommitId at) {
    Values values;
    sqlite::Statement commits = database_.prepare(
        fmt::format("SELECT {} FROM commits WHERE id <= ?1 ORDER BY id", kCommitColumns));
    commits.bind_all(at.value);
    sqlite::Statement rows = database_.prepare(
        "SELECT kind, object, value FROM changes WHERE commit_id = ?1 ORDER BY number");
    std::uint64_t expected = 0;
    while (commits.step()) {
      const AtlasCommit commit = commit_of(commits);
      if (expected != 0 && commit.id.value != expected) {
        damaged(name(), fmt::format("the log: commit {} is missing; it", expected));
      }
      expected = commit.id.value + 1;
      const std::vector<Change> changes = read_changes(rows, commit.id);
      bool sound = as_text(commits.blob(8)) == commit_digest(commit, changes);
      for (const Change& change : changes) sound = values.apply(change) && sound;
      if (!sound) damaged(name(), fmt::format("commit {}", commit.id.value));
    }
    return values;
  }

  static std::vector<Change> read_changes(sqlite::Statement& rows, CommitId commit) {
    std::vector<Change> changes;
    rows.bind_all(commit.value);
    while (rows.step()) {
      Change change{rows.integer(0), rows.unsigned_integer(1), std::nullopt};
      if (!rows.is_null(2)) change.value = rows.unsigned_integer(2);
      changes.push_back(change);
    }
    return changes;
  }

  AtlasState read_state(CommitId at) {
    const Values values = read_values(at);
    AtlasState state;
    state.commit = at;
    read_rows("nodes", kNodeColumns, values.nodes, [&](const sqlite::Statement& row) {
      const AtlasNode node = node_of(row, name());
      state.nodes[node.id] = node;
    });
    read_rows("links", kLinkColumns, values.links, [&](const sqlite::Statement& row) {
      const AtlasLink link = link_of(row, name());
      state.links[link.id] = link;
    });
    read_rows("poses", kPoseColumns, values.poses, [&](const sqlite::Statement& row) {
      const AtlasPose pose = pose_of(row, name());
      state.poses[pose.node] = pose;
    });
    for (const auto& [link, agrees] : values.agrees) state.agrees[AtlasLinkId{link}] = agrees != 0;
    return state;
  }

  template <class Take>
  void read_rows(const char* table, const char* columns,
                 const std::map<std::uint64_t, std::uint64_t>& values, const Take& take) {
    sqlite::Statement row =
        database_.prepare(fmt::format("SELECT {} FROM {} WHERE id = ?1", columns, table));
    for (const auto& [object, value] : values) {
      if (!row.bind_all(value).step()) {
        damaged(name(), fmt::format("the table of {}: row {} is missing; it", table, value));
      }
      take(row);
      row.reset();
    }
  }

  std::uint64_t next_id(const char* table, std::int64_t kind) {
    // Ids of dropped objects are not given out again, as the log may name them.
    const std::int64_t of_rows =
        database_.integer(fmt::format("SELECT coalesce(max(id), 0) FROM {}", table));
    const std::int64_t of_changes =
        database_.integer(fmt::format("SELECT coalesce(max({}), 0) FROM changes WHERE kind = {}",
                                      kind == kPose ? "value" : "object", kind));
    return static_cast<std::uint64_t>(std::max(of_rows, of_changes)) + 1;
  }

  // Gives new objects their ids and writes their rows. @return the changes as the log has them
  std::vector<Change> write_objects(AtlasChanges& changes, AtlasCommitted& committed) {
    std::vector<Change> rows;
    for (const NodeId id : changes.removed_nodes) rows.push_back({kNode, id.value, std::nullopt});
    for (const AtlasLinkId id : changes.removed_links) {
      rows.push_back({kLink, id.value, std::nullopt});
    }
    for (const NodeId id : changes.removed_poses) rows.push_back({kPose, id.value, std::nullopt});
    for (const AtlasLinkId id : changes.removed_agrees) {
      rows.push_back({kAgrees, id.value, std::nullopt});
    }
    std::uint64_t next = changes.nodes.empty() ? 0 : next_id("nodes", kNode);
    for (AtlasNode& node : changes.nodes) {
      if (node.id.value == 0) {
        node.id = NodeId{next++};
        committed.nodes.push_back(node.id);
        insert(node);
      }
      rows.push_back({kNode, node.id.value, node.id.value});
    }
    next = changes.links.empty() ? 0 : next_id("links", kLink);
    for (AtlasLink& link : changes.links) {
      if (link.id.value == 0) {
        link.id = AtlasLinkId{next++};
        committed.links.push_back(link.id);
        insert(link);
      }
      rows.push_back({kLink, link.id.value, link.id.value});
    }
    next = changes.poses.empty() ? 0 : next_id("poses", kPose);
    for (const AtlasPose& pose : changes.poses) {
      insert(pose, next);
      rows.push_back({kPose, pose.node.value, next++});
    }
    for (const auto& [id, agrees] : changes.agrees) {
      rows.push_back({kAgrees, id.value, agrees ? 1U : 0U});
    }
    return rows;
  }

 public:
  void insert(const AtlasNode& node) {
    const auto key = bytes_of_hexadecimal(node.map);
    sqlite::Statement known = database_.prepare("SELECT 1 FROM maps WHERE hash = ?1");
    if (!key || !known.bind_all(as_blob(*key)).step()) {
      throw Error(ErrorKind::kMisuse, "AtlasNode.map", printable(node.map),
                  "the hash that put_map() gave");
    }
    database_.run(
        fmt::format("INSERT INTO nodes ({}) VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10)",
                    kNodeColumns),
        node.id.value, node.name, node.session, as_blob(*key),
        static_cast<std::int64_t>(node.length_unit), node.frames, node.landmarks, node.observations,
        as_blob(extent_bytes(node.extent)), as_blob(digest_of(node)));
  }

  void insert(const AtlasLink& link) {
    using Blob = std::optional<std::span<const std::byte>>;
    const LinkBlobs blobs = blobs_of(link);
    const auto or_null = [](const std::string& bytes) {
      return bytes.empty() ? Blob() : Blob(as_blob(bytes));
    };
    const bool sound =
        (!link.target_from_source || pose_of_bytes(blobs.target_from_source)) &&
        (!link.covariance || covariance6_of_bytes(blobs.covariance)) &&
        (!link.covariance_with_scale || covariance7_of_bytes(blobs.covariance_with_scale));
    if (!sound) {
      throw Error(ErrorKind::kMisuse, "AtlasLink", "a transform or covariance that is none",
                  "finite numbers and a positive semidefinite covariance");
    }
    database_.run(
        fmt::format("INSERT INTO links ({}) VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11)",
                    kLinkColumns),
        link.id.value, link.target.value, link.source.value, static_cast<std::int64_t>(link.kind),
        static_cast<std::int64_t>(link.verdict), link.probability, link.reason,
        or_null(blobs.target_from_source), or_null(blobs.covariance),
        or_null(blobs.covariance_with_scale), as_blob(digest_of(link, blobs)));
  }

  void insert(const AtlasPose& pose, std::uint64_t row) {
    const PoseBlobs blobs = blobs_of(pose);
    if (!pose_of_bytes(blobs.frame_from_node) || !covariance7_of_bytes(blobs.covariance)) {
      throw Error(ErrorKind::kMisuse, "AtlasPose", "a pose or covariance that is none",
                  "finite numbers and a positive semidefinite covariance");
    }
    database_.run(
        fmt::format("INSERT INTO poses ({}) VALUES (?1, ?2, ?3, ?4, ?5, ?6)", kPoseColumns), row,
        pose.node.value, pose.frame.value, as_blob(blobs.frame_from_node),
        as_blob(blobs.covariance), as_blob(digest_of(pose, row, blobs)));
  }

  void write_commit(const AtlasCommit& commit, std::span<const Change> changes) {
    database_.run(
        fmt::format("INSERT INTO commits ({}) VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9)",
                    kCommitColumns),
        commit.id.value, commit.time_ms, commit.author, commit.host, commit.verb, commit.text,
        commit.undoes ? std::optional(commit.undoes->value) : std::nullopt, commit.run.value,
        as_blob(commit_digest(commit, changes)));
    sqlite::Statement insert = database_.prepare("INSERT INTO changes VALUES (?1, ?2, ?3, ?4, ?5)");
    for (std::size_t i = 0; i < changes.size(); ++i) {
      insert.run(commit.id.value, i, changes[i].kind, changes[i].object, changes[i].value);
    }
  }

  sqlite::Database& database() { return database_; }

 private:
  sqlite::Database database_;
  AtlasStoreOptions options_;
  std::optional<AtlasState> newest_;
};

AtlasVerification SqliteStore::verify() {
  AtlasVerification result;
  const sqlite::Transaction same(database_, sqlite::Transaction::Kind::kRead);
  const auto attempt = [&](const auto& what) {
    try {
      what();
    } catch (const Error& error) {
      if (error.kind() == ErrorKind::kCancelled) throw;
      result.problems.emplace_back(error.what());
    }
  };
  attempt([&] {
    sqlite::Statement rows = database_.prepare("PRAGMA integrity_check(20)");
    while (rows.step()) {
      if (rows.text(0) != "ok") {
        result.problems.push_back(fmt::format("{}: {}", name(), printable(rows.text(0))));
      }
    }
  });
  const auto count = [&](const char* table) {
    return static_cast<std::uint64_t>(
        database_.integer(fmt::format("SELECT count(*) FROM {}", table)));
  };
  attempt([&] {
    result.commits = count("commits");
    result.nodes = count("nodes");
    result.links = count("links");
    result.poses = count("poses");
    result.maps = count("maps");
    result.map_bytes =
        static_cast<std::uint64_t>(database_.integer("SELECT coalesce(sum(bytes), 0) FROM maps"));
  });
  attempt([&] { check_state(read_state(last_commit()), name()); });
  const auto check_rows = [&](const char* table, const char* columns, const auto& read) {
    std::vector<std::uint64_t> ids;
    attempt([&] {
      sqlite::Statement rows = database_.prepare(fmt::format("SELECT id FROM {}", table));
      while (rows.step()) ids.push_back(rows.unsigned_integer(0));
    });
    for (const std::uint64_t id : ids) {
      attempt([&] {
        sqlite::Statement row =
            database_.prepare(fmt::format("SELECT {} FROM {} WHERE id = ?1", columns, table));
        if (row.bind_all(id).step()) read(row);
      });
    }
  };
  std::set<std::string> hashes;
  check_rows("nodes", kNodeColumns,
             [&](const sqlite::Statement& row) { hashes.insert(node_of(row, name()).map); });
  check_rows("links", kLinkColumns, [&](const sqlite::Statement& row) { link_of(row, name()); });
  check_rows("poses", kPoseColumns, [&](const sqlite::Statement& row) { pose_of(row, name()); });
  for (const std::string& hash : hashes) {
    attempt([&] {
      const std::string bytes = map_bytes(hash);
      MemoryReader reader(bytes, fmt::format("{}: map {}", name(), hash));
      read_binary(reader);
    });
  }
  // One cause often shows more than once.
  std::vector<std::string> distinct;
  for (std::string& problem : result.problems) {
    if (std::find(distinct.begin(), distinct.end(), problem) == distinct.end()) {
      distinct.push_back(std::move(problem));
    }
  }
  result.problems = std::move(distinct);
  return result;
}

AtlasCompaction SqliteStore::compact(std::uint64_t keep, bool dry) {
  AtlasCompaction result;
  sqlite::Transaction transaction(database_);
  const CommitId last = last_commit();
  const auto first =
      static_cast<std::uint64_t>(database_.integer("SELECT coalesce(min(id), 0) FROM commits"));
  if (first == 0) return result;
  keep = std::max<std::uint64_t>(keep, 1);
  // Becomes the oldest that is left.
  const CommitId base{last.value + 1 > first + keep ? last.value + 1 - keep : first};
  result.commits = base.value - first;
  if (result.commits > 0) {
    const Values values = read_values(base);
    std::vector<Change> changes;
    for (const auto& [object, value] : values.nodes) changes.push_back({kNode, object, value});
    for (const auto& [object, value] : values.links) changes.push_back({kLink, object, value});
    for (const auto& [object, value] : values.poses) changes.push_back({kPose, object, value});
    for (const auto& [object, value] : values.agrees) changes.push_back({kAgrees, object, value});
    sqlite::Statement row =
        database_.prepare(fmt::format("SELECT {} FROM commits WHERE id = ?1", kCommitColumns));
    row.bind_all(base.value).step();
    AtlasCommit commit = commit_of(row);
    row.reset();
    commit.run = commit.id;
    commit.undoes.reset();
    commit.text += fmt::format(" (and {} commits before it)", result.commits);
    database_.run("DELETE FROM commits WHERE id <= ?1", base.value);
    database_.run("DELETE FROM changes WHERE commit_id <= ?1", base.value);
    write_commit(commit, changes);
  }
  const auto drop = [&](const std::string& from_where) {
    database_.run("DELETE FROM " + from_where);
    return static_cast<std::uint64_t>(database_.changes());
  };
  result.nodes =
      drop("nodes WHERE id NOT IN (SELECT value FROM changes WHERE kind = 1 AND value NOT NULL)");
  result.links =
      drop("links WHERE id NOT IN (SELECT value FROM changes WHERE kind = 2 AND value NOT NULL)");
  result.poses =
      drop("poses WHERE id NOT IN (SELECT value FROM changes WHERE kind = 3 AND value NOT NULL)");
  result.map_bytes = static_cast<std::uint64_t>(database_.integer(
      "SELECT coalesce(sum(bytes), 0) FROM maps WHERE hash NOT IN (SELECT map FROM nodes)"));
  result.maps = drop("maps WHERE hash NOT IN (SELECT map FROM nodes)");
  drop("map_chunks WHERE map NOT IN (SELECT id FROM maps)");
  if (dry) return result;
  newest_.reset();
  transaction.commit();
  database_.execute("PRAGMA incremental_vacuum");
  database_.execute("PRAGMA wal_checkpoint(TRUNCATE)");
  return result;
}

fs::path folder_of(const fs::path& path) {
  return path.has_parent_path() ? path.parent_path() : fs::path(".");
}

void require_local(const fs::path& path, const AtlasStoreOptions& options) {
  if (options.insist) return;
  struct statfs system {};
  std::error_code ignored;
  const fs::path there = fs::exists(path, ignored) ? path : folder_of(path);
  if (::statfs(there.c_str(), &system) != 0) return;  // opening it will say why
  const char* const kind = network_file_system(static_cast<long>(system.f_type));
  if (kind == nullptr) return;
  throw Error(
      ErrorKind::kStorage, path.string(), fmt::format("lies on {}", kind),
      "a local disk: locks over a network can fail and damage it; --insist if you are sure");
}

void configure(sqlite::Database& database) {
  database.execute("PRAGMA synchronous = FULL");
  database.execute("PRAGMA foreign_keys = ON");
}

void migrate(sqlite::Database& database, std::int64_t from) {
  for (std::int64_t schema = from; schema < kAtlasSchema; ++schema) {
    database.execute(kMigrations[static_cast<std::size_t>(schema)]);
  }
  database.execute(fmt::format("PRAGMA user_version = {}", kAtlasSchema));
}

// A file that only this process can know of, until it is complete.
fs::path unfinished(const fs::path& path) {
  return folder_of(path) /
         fmt::format(".{}.{}.cairn-unfinished", path.filename().string(), ::getpid());
}

void refuse_existing(const fs::path& path) {
  throw Error(ErrorKind::kStorage, path.string(), "exists already", "a name that is free");
}

}  // namespace

const char* network_file_system(long type) {
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

void create_sqlite_store(const fs::path& path, const AtlasStoreOptions& options) {
  std::error_code failure;
  if (fs::exists(fs::symlink_status(path, failure))) refuse_existing(path);
  require_local(path, options);
  const fs::path temporary = unfinished(path);
  const auto remove_rest = [&] {
    std::error_code ignored;
    for (const char* const ending : {"", "-wal", "-shm", "-journal"}) {
      fs::remove(temporary.string() + ending, ignored);
    }
  };
  remove_rest();
  try {
    {
      sqlite::Database database(
          temporary,
          {.access = sqlite::Access::kCreate, .busy_timeout = options.wait, .stop = options.stop});
      configure(database);
      // So that compact() can give space back.
      database.execute("PRAGMA auto_vacuum = INCREMENTAL");
      database.execute("PRAGMA journal_mode = WAL");
      sqlite::Transaction transaction(database);
      database.execute(fmt::format("PRAGMA application_id = {}", kApplicationId));
      migrate(database, 0);
      transaction.commit();
    }
    // Unlike a renaming, a link never replaces what another process has made meanwhile.
    fs::create_hard_link(temporary, path, failure);
    if (failure == std::errc::file_exists) refuse_existing(path);
    if (failure) fs::rename(temporary, path);
    remove_rest();
    sync_files(folder_of(path));
  } catch (const fs::filesystem_error& error) {
    remove_rest();
    throw Error(ErrorKind::kStorage, path.string(), error.code().message(), "a place to write to");
  } catch (const Error& error) {
    remove_rest();
    // The temporary file's name means nothing to people.
    std::string text = error.what();
    const std::size_t at = text.find(temporary.string());
    if (at == text.npos) throw;
    throw Error(error.kind(), "", text.replace(at, temporary.string().size(), path.string()), "");
  } catch (...) {
    remove_rest();
    throw;
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
  sqlite::OpenOptions how{
      .access = options.read_only ? sqlite::Access::kRead : sqlite::Access::kWrite,
      .busy_timeout = options.wait,
      .stop = options.stop};
  const auto open = [&] {
    sqlite::Database database(path, how);
    const std::int64_t application = database.integer("PRAGMA application_id");
    if (application != kApplicationId) {
      throw Error(ErrorKind::kInput, path.string(), "an SQLite database, but no atlas", "an atlas");
    }
    return database;
  };
  if (!options.read_only) return open();
  try {
    return open();
  } catch (const Error& error) {
    // Where no file can be made beside it, nobody writes either, if no journal waits to be taken over.
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
  if (schema > kAtlasSchema || schema < 1) {
    throw Error(ErrorKind::kInput, path.string(), fmt::format("an atlas of schema {}", schema),
                fmt::format("schema {} or older: a newer version of cairn wrote it", kAtlasSchema));
  }
  if (schema == kAtlasSchema) return;
  if (read_only) {
    throw Error(ErrorKind::kInput, path.string(), fmt::format("an atlas of schema {}", schema),
                fmt::format("schema {}: a command that writes brings it there", kAtlasSchema));
  }
  sqlite::Transaction transaction(database);
  // Another process may have been faster.
  migrate(database, database.integer("PRAGMA user_version"));
  transaction.commit();
}

}  // namespace

bool is_sqlite_store(const std::filesystem::path& path) {
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

std::unique_ptr<AtlasStore> open_sqlite_store(const fs::path& path,
                                              const AtlasStoreOptions& options) {
  sqlite::Database database = open_database(path, options);
  if (!options.read_only) configure(database);
  require_schema(database, path, options.read_only);
  for (const char* const table :
       {"commits", "changes", "maps", "map_chunks", "nodes", "links", "poses"}) {
    if (!database.has_table(table)) damaged(path.string(), fmt::format("the table {}", table));
  }
  return std::make_unique<SqliteStore>(std::move(database), options);
}

AtlasSalvage salvage_sqlite_store(const fs::path& from, const fs::path& to,
                                  const AtlasStoreOptions& options) {
  AtlasSalvage result;
  AtlasStoreOptions reading = options;
  reading.read_only = true;
  sqlite::Database database = open_database(from, reading);
  require_schema(database, from, true);
  const std::string name = from.string();

  const auto lose = [&](const std::string& what) {
    if (result.lost.size() < 1000) result.lost.push_back(what);
  };
  // Rows one by one from both ends, so that what lies behind a damaged page is found as well.
  const auto each = [&](const char* table, const char* columns, const auto& take) {
    std::set<std::int64_t> seen;
    bool cut_short = false;
    for (const bool ascending : {true, false}) {
      try {
        std::int64_t after = ascending ? std::numeric_limits<std::int64_t>::min()
                                       : std::numeric_limits<std::int64_t>::max();
        sqlite::Statement next = database.prepare(
            ascending
                ? fmt::format("SELECT id FROM {} WHERE id > ?1 ORDER BY id LIMIT 1", table)
                : fmt::format("SELECT id FROM {} WHERE id < ?1 ORDER BY id DESC LIMIT 1", table));
        while (next.bind_all(after).step()) {
          after = next.integer(0);
          next.reset();
          if (!seen.insert(after).second) break;
          try {
            sqlite::Statement row =
                database.prepare(fmt::format("SELECT {} FROM {} WHERE id = ?1", columns, table));
            if (row.bind_all(after).step()) take(row);
          } catch (const Error& error) {
            if (error.kind() == ErrorKind::kCancelled) throw;
            lose(fmt::format("{} {}: {}", table, after, error.what()));
          }
        }
        if (!cut_short) break;
      } catch (const Error& error) {
        if (error.kind() == ErrorKind::kCancelled) throw;
        if (!cut_short) lose(fmt::format("some of the {}: {}", table, error.what()));
        cut_short = true;
      }
    }
  };

  // What was there last, as far as the log can be read.
  Values values;
  bool log_is_sound = true;
  try {
    sqlite::Statement rows =
        database.prepare("SELECT kind, object, value FROM changes ORDER BY commit_id, number");
    while (rows.step()) {
      Change change{rows.integer(0), rows.unsigned_integer(1), std::nullopt};
      if (!rows.is_null(2)) change.value = rows.unsigned_integer(2);
      values.apply(change);
    }
  } catch (const Error& error) {
    if (error.kind() == ErrorKind::kCancelled) throw;
    log_is_sound = false;
    lose(fmt::format("some of the log, so that what was removed may be there again: {}",
                     error.what()));
  }
  const auto was_there = [&](const std::map<std::uint64_t, std::uint64_t>& of, std::uint64_t id) {
    return !log_is_sound || of.contains(id);
  };

  create_sqlite_store(to, options);
  const std::unique_ptr<AtlasStore> store = open_sqlite_store(to, options);
  SqliteStore source(open_database(from, reading), reading);
  std::map<NodeId, NodeId> new_of_old;
  std::set<std::string> names;
  AtlasChanges changes;
  std::vector<NodeId> old_nodes;
  each("nodes", kNodeColumns, [&](const sqlite::Statement& row) {
    AtlasNode node = node_of(row, name);
    if (!was_there(values.nodes, node.id.value)) return;
    const std::string bytes = source.map_bytes(node.map);
    MemoryReader reader(bytes, fmt::format("map {}", node.name));
    read_binary(reader);
    store->put_map(bytes);
    while (!names.insert(node.name).second) node.name += "~";
    old_nodes.push_back(node.id);
    node.id = NodeId{};
    changes.nodes.push_back(std::move(node));
  });
  changes.text = fmt::format("salvaged {} maps from {}", changes.nodes.size(), name);
  AtlasCommitInfo info{.verb = "salvage"};
  const AtlasCommitted added = store->commit(info, [&](const AtlasState&) { return changes; });
  for (std::size_t i = 0; i < old_nodes.size(); ++i) new_of_old[old_nodes[i]] = added.nodes[i];
  result.maps = old_nodes.size();

  AtlasChanges rest;
  std::vector<AtlasLinkId> old_links;
  each("links", kLinkColumns, [&](const sqlite::Statement& row) {
    AtlasLink link = link_of(row, name);
    if (!was_there(values.links, link.id.value)) return;
    if (!new_of_old.contains(link.target) || !new_of_old.contains(link.source)) return;
    old_links.push_back(link.id);
    link.id = AtlasLinkId{};
    link.target = new_of_old[link.target];
    link.source = new_of_old[link.source];
    rest.links.push_back(std::move(link));
  });
  std::set<std::uint64_t> last_poses;
  for (const auto& [node, row] : values.poses) last_poses.insert(row);
  each("poses", kPoseColumns, [&](const sqlite::Statement& row) {
    AtlasPose pose = pose_of(row, name);
    if (!log_is_sound || !last_poses.contains(row.unsigned_integer(0))) return;
    if (!new_of_old.contains(pose.node) || !new_of_old.contains(pose.frame)) return;
    pose.node = new_of_old[pose.node];
    pose.frame = new_of_old[pose.frame];
    rest.poses.push_back(pose);
  });
  result.links = rest.links.size();
  result.poses = rest.poses.size();
  rest.text = fmt::format("salvaged {} links and {} poses", result.links, result.poses);
  info.run = added.commit;
  const AtlasCommitted linked = store->commit(info, [&](const AtlasState&) { return rest; });
  AtlasChanges agreements;
  for (std::size_t i = 0; i < old_links.size(); ++i) {
    const auto found = values.agrees.find(old_links[i].value);
    if (found != values.agrees.end())
      agreements.agrees.emplace_back(linked.links[i], found->second != 0);
  }
  agreements.text = fmt::format("salvaged {} agreements", agreements.agrees.size());
  store->commit(info, [&](const AtlasState&) { return agreements; });
  return result;
}

}  // namespace cairn
