// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/atlas/detail/sql_store.hpp"

#include <algorithm>
#include <chrono>
#include <set>

#include <fmt/format.h>

#include "cairn/atlas/detail/row_bytes.hpp"
#include "cairn/core/detail/hash.hpp"
#include "cairn/core/error.hpp"
#include "cairn/formats/map_file.hpp"

namespace cairn::detail {
namespace {

constexpr const char* kCommitColumns = "id, time_ms, author, host, verb, text, undoes, run, digest";

std::span<const std::byte> as_blob(std::string_view bytes) {
  return std::as_bytes(std::span(bytes.data(), bytes.size()));
}

std::string_view as_text(std::span<const std::byte> blob) {
  return {reinterpret_cast<const char*>(blob.data()), blob.size()};
}

std::int64_t now_ms() {
  return std::chrono::duration_cast<std::chrono::milliseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

AtlasCommit commit_of(const Statement& row) {
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

// The transaction of the commit() that calls this, or its own.
class Within {
 public:
  Within(storage::Database& database, storage::Transaction::Kind kind) {
    if (!database.in_transaction()) own_.emplace(database, kind);
  }
  void commit() {
    if (own_) own_->commit();
  }

 private:
  std::optional<storage::Transaction> own_;
};

}  // namespace

AtlasNode node_of(const Statement& row, const std::string& name) {
  const auto what = [&] { return fmt::format("map {}", row.integer(0)); };
  AtlasNode node;
  node.id = NodeId{row.unsigned_integer(0)};
  node.name = row.text(1);
  node.session = row.text(2);
  node.map = hexadecimal(as_text(row.blob(3)));
  const std::int64_t unit = row.integer(4);
  if (unit != 0 && unit != 1) fail_as_damaged(name, what());
  node.length_unit = unit == 0 ? LengthUnit::kMetres : LengthUnit::kFree;
  node.frames = row.unsigned_integer(5);
  node.landmarks = row.unsigned_integer(6);
  node.observations = row.unsigned_integer(7);
  const auto extent = extent_of_bytes(as_text(row.blob(8)));
  if (!extent) fail_as_damaged(name, what());
  node.extent = *extent;
  if (as_text(row.blob(9)) != digest_of(node)) fail_as_damaged(name, what());
  return node;
}

Link link_of(const Statement& row, const std::string& name) {
  const auto what = [&] { return fmt::format("link {}", row.integer(0)); };
  Link link;
  link.id = LinkId{row.unsigned_integer(0)};
  link.target = NodeId{row.unsigned_integer(1)};
  link.source = NodeId{row.unsigned_integer(2)};
  const std::int64_t kind = row.integer(3);
  const std::int64_t verdict = row.integer(4);
  if (kind < 0 || kind > 2 || verdict < 0 || verdict > 2) fail_as_damaged(name, what());
  link.kind = static_cast<LinkKind>(kind);
  link.verdict = verdict_of_stored(link.kind, static_cast<Verdict>(verdict));
  link.probability = row.optional_real(5);
  link.reason = row.text(6);
  const auto blob = [&](int column) {
    const auto bytes = row.optional_blob(column);
    return bytes ? std::string(as_text(*bytes)) : std::string();
  };
  const LinkBlobs blobs{blob(7), blob(8), blob(9)};
  if (as_text(row.blob(10)) != digest_of(link, blobs)) fail_as_damaged(name, what());
  const auto take = [&](const std::string& bytes, auto& value, const auto& parsed) {
    if (bytes.empty()) return;
    value = parsed(bytes);
    if (!value) fail_as_damaged(name, what());
  };
  take(blobs.target_from_source, link.target_from_source, pose_of_bytes);
  take(blobs.covariance, link.covariance, covariance6_of_bytes);
  take(blobs.covariance_with_scale, link.covariance_with_scale, covariance7_of_bytes);
  return link;
}

AtlasPose pose_of(const Statement& row, const std::string& name) {
  const auto what = [&] { return fmt::format("pose {}", row.integer(0)); };
  AtlasPose pose;
  pose.node = NodeId{row.unsigned_integer(1)};
  pose.frame = NodeId{row.unsigned_integer(2)};
  const PoseBlobs blobs{std::string(as_text(row.blob(3))), std::string(as_text(row.blob(4)))};
  const auto frame_from_node = pose_of_bytes(blobs.frame_from_node);
  const auto covariance = covariance7_of_bytes(blobs.covariance);
  if (!frame_from_node || !covariance ||
      as_text(row.blob(5)) != digest_of(pose, row.unsigned_integer(0), blobs)) {
    fail_as_damaged(name, what());
  }
  pose.frame_from_node = *frame_from_node;
  pose.covariance = *covariance;
  return pose;
}

RowChange change_of(const Statement& row) {
  RowChange change{row.integer(0), row.unsigned_integer(1), std::nullopt};
  if (!row.is_null(2)) change.value = row.unsigned_integer(2);
  return change;
}

CommitId SqlStore::last_commit() {
  const Within same(database_, storage::Transaction::Kind::kRead);
  const std::int64_t last = database_.integer("SELECT coalesce(max(id), 0) FROM commits");
  // A damaged page can hide the last commits, whose digests then tell nothing.
  if (database_.integer("SELECT coalesce(max(commit_id), 0) FROM changes") > last) {
    fail_as_damaged(name(), fmt::format("the log: a commit after {} is missing; it", last));
  }
  return CommitId{static_cast<std::uint64_t>(last)};
}

AtlasState SqlStore::state(std::optional<CommitId> at) {
  const Within same(database_, storage::Transaction::Kind::kRead);
  const CommitId last = last_commit();
  if (at && *at > last) {
    throw Error(ErrorKind::kMisuse, name(), fmt::format("commit {}", at->value),
                fmt::format("one of its commits, the last of which is {}", last.value));
  }
  if (at) {
    const std::uint64_t first = first_commit();
    refuse_if(at->value < first && !(at->value == 0 && first <= 1), name(),
              fmt::format("commit {}", at->value),
              fmt::format("commit {} or later: what was before is compacted", first));
  }
  return read_state(at.value_or(last));
}

std::vector<AtlasCommit> SqlStore::log() {
  const Within same(database_, storage::Transaction::Kind::kRead);
  std::vector<AtlasCommit> commits;
  for_each_commit(last_commit(), [&](const AtlasCommit& commit, std::span<const RowChange>) {
    commits.push_back(commit);
    return true;
  });
  return commits;
}

AtlasTouched SqlStore::touched(std::span<const CommitId> commits) {
  AtlasTouched touched;
  std::set<std::pair<std::int64_t, std::uint64_t>> seen;
  Statement rows =
      database_.prepare("SELECT kind, object FROM changes WHERE commit_id = ?1 ORDER BY number");
  for (const CommitId commit : commits) {
    rows.bind_all(commit.value);
    while (rows.step()) {
      const std::int64_t kind = rows.integer(0);
      const std::uint64_t object = rows.unsigned_integer(1);
      if (!seen.emplace(kind, object).second) continue;
      if (kind == kNode) touched.nodes.push_back(NodeId{object});
      if (kind == kLink) touched.links.push_back(LinkId{object});
      if (kind == kPose) touched.poses.push_back(NodeId{object});
      if (kind == kAgrees) touched.agrees.push_back(LinkId{object});
    }
  }
  return touched;
}

std::string SqlStore::put_map(std::string_view bytes) {
  std::string hash = to_string(hash_of(bytes));
  const std::string key = *bytes_of_hexadecimal(hash);
  Within transaction(database_, storage::Transaction::Kind::kWrite);
  Statement known = database_.prepare("SELECT id FROM maps WHERE hash = ?1");
  if (known.bind_all(as_blob(key)).step()) return hash;
  Statement added =
      database_.prepare("INSERT INTO maps (hash, bytes) VALUES (?1, ?2) RETURNING id");
  added.bind_all(as_blob(key), bytes.size()).step();
  const std::int64_t map = added.integer(0);
  added.step();
  Statement insert = database_.prepare("INSERT INTO map_chunks VALUES (?1, ?2, ?3)");
  for (std::size_t at = 0, number = 0; at < bytes.size(); at += kChunkBytes, ++number) {
    insert.run(map, number, as_blob(bytes.substr(at, kChunkBytes)));
  }
  transaction.commit();
  return hash;
}

std::string SqlStore::map_bytes(const std::string& hash) {
  const Within same(database_, storage::Transaction::Kind::kRead);
  const std::string what = fmt::format("the stored map {}", hash);
  const auto key = bytes_of_hexadecimal(hash);
  if (!key) fail_as_damaged(name(), what);
  Statement row = database_.prepare("SELECT id, bytes FROM maps WHERE hash = ?1");
  if (!row.bind_all(as_blob(*key)).step()) {
    Statement node = database_.prepare("SELECT 1 FROM nodes WHERE map = ?1");
    if (node.bind_all(as_blob(*key)).step()) fail_as_damaged(name(), what);
    throw Error(ErrorKind::kStorage, name(),
                fmt::format("{} was removed and compacted by another process", what),
                "to be tried again");
  }
  const std::int64_t map = row.integer(0);
  const std::uint64_t size = row.unsigned_integer(1);
  Statement chunks =
      database_.prepare("SELECT bytes FROM map_chunks WHERE map = ?1 ORDER BY number");
  chunks.bind_all(map);
  std::string bytes;
  while (chunks.step()) {
    const std::string_view chunk = as_text(chunks.blob(0));
    if (chunk.size() > size - bytes.size()) fail_as_damaged(name(), what);
    bytes += chunk;
  }
  if (bytes.size() != size || to_string(hash_of(bytes)) != hash) fail_as_damaged(name(), what);
  return bytes;
}

AtlasCommitted SqlStore::commit(const AtlasCommitInfo& info, const Make& make) {
  storage::Transaction transaction(database_);
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
  commit.undoes = changes.undoes;
  commit.run = info.run.value == 0 ? commit.id : info.run;
  const std::vector<RowChange> rows = write_objects(changes, committed);
  AtlasState next = *newest_;
  apply(changes, next);
  next.commit = commit.id;
  check_state(next, name(), ErrorKind::kMisuse);
  check_agreements(*newest_, next, name());
  write_commit(commit, rows);
  transaction.commit();
  committed.commit = commit.id;
  committed.is_new = true;
  newest_ = std::move(next);
  return committed;
}

AtlasVerification SqlStore::verify() {
  AtlasVerification result;
  const storage::Transaction same(database_, storage::Transaction::Kind::kRead);
  const auto attempt = [&](const auto& what) {
    try {
      what();
    } catch (const Error& error) {
      if (error.kind() == ErrorKind::kCancelled) throw;
      // One cause often appears more than once.
      const std::string text = error.what();
      if (std::ranges::find(result.problems, text) == result.problems.end()) {
        result.problems.push_back(text);
      }
    }
  };
  attempt([&] { check_files(result.problems); });
  attempt([&] { count_rows(result); });
  attempt([&] { read_state(last_commit()); });
  const auto check_rows = [&](const char* table, const char* columns, const auto& read) {
    std::vector<std::uint64_t> ids;
    attempt([&] {
      Statement rows = database_.prepare(fmt::format("SELECT id FROM {}", table));
      while (rows.step()) ids.push_back(rows.unsigned_integer(0));
    });
    for (const std::uint64_t id : ids) {
      attempt([&] {
        Statement row =
            database_.prepare(fmt::format("SELECT {} FROM {} WHERE id = ?1", columns, table));
        if (row.bind_all(id).step()) read(row);
      });
    }
  };
  std::set<std::string> hashes;
  check_rows("nodes", kNodeColumns,
             [&](const Statement& row) { hashes.insert(node_of(row, name()).map); });
  check_rows("links", kLinkColumns, [&](const Statement& row) { link_of(row, name()); });
  check_rows("poses", kPoseColumns, [&](const Statement& row) { pose_of(row, name()); });
  for (const std::string& hash : hashes) {
    attempt([&] {
      const std::string bytes = map_bytes(hash);
      MemoryReader reader(bytes, fmt::format("{}: map {}", name(), hash));
      read_binary(reader);
    });
  }
  return result;
}

std::uint64_t SqlStore::first_commit() {
  return static_cast<std::uint64_t>(database_.integer("SELECT coalesce(min(id), 0) FROM commits"));
}

void SqlStore::count_rows(AtlasVerification& result) {
  const auto count = [&](const char* table) {
    return static_cast<std::uint64_t>(
        database_.integer(fmt::format("SELECT count(*) FROM {}", table)));
  };
  result.commits = count("commits");
  result.nodes = count("nodes");
  result.links = count("links");
  result.poses = count("poses");
  result.maps = count("maps");
  result.map_bytes = bytes_of_maps();
}

std::uint64_t SqlStore::bytes_of_maps(const std::string& where) {
  return static_cast<std::uint64_t>(
      database_.integer("SELECT CAST(coalesce(sum(bytes), 0) AS BIGINT) FROM maps " + where));
}

AtlasCompaction SqlStore::compact(std::uint64_t keep, bool dry) {
  if (keep < 1) throw Error(ErrorKind::kMisuse, "keep", "0", "at least 1 commit");
  AtlasCompaction result;
  storage::Transaction transaction(database_);
  const CommitId last = last_commit();
  const std::uint64_t first = first_commit();
  if (first == 0) return result;
  // Becomes the oldest remaining commit.
  const CommitId base{last.value + 1 > first + keep ? last.value + 1 - keep : first};
  result.commits = base.value - first;
  if (result.commits > 0) {
    const RowValues values = read_values(base);
    std::vector<RowChange> changes;
    // As removals, so that next_id() stays above the ids of what is dropped.
    for (const auto& [table, kind] : {std::pair("nodes", kNode), std::pair("links", kLink)}) {
      const std::uint64_t highest = next_id(table, kind) - 1;
      if (highest > 0) changes.push_back({kind, highest, std::nullopt});
    }
    for (const auto& [object, value] : values.nodes) changes.push_back({kNode, object, value});
    for (const auto& [object, value] : values.links) changes.push_back({kLink, object, value});
    for (const auto& [object, value] : values.poses) changes.push_back({kPose, object, value});
    for (const auto& [object, value] : values.agrees) changes.push_back({kAgrees, object, value});
    Statement row =
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
  const auto drop_unused = [&](const char* table, RowKind kind) {
    return drop(fmt::format(
        "{} WHERE id NOT IN (SELECT value FROM changes WHERE kind = {} AND value IS NOT NULL)",
        table, static_cast<std::int64_t>(kind)));
  };
  result.nodes = drop_unused("nodes", kNode);
  result.links = drop_unused("links", kLink);
  result.poses = drop_unused("poses", kPose);
  result.map_bytes = bytes_of_maps("WHERE hash NOT IN (SELECT map FROM nodes)");
  result.maps = drop("maps WHERE hash NOT IN (SELECT map FROM nodes)");
  drop("map_chunks WHERE map NOT IN (SELECT id FROM maps)");
  if (dry) return result;
  newest_.reset();
  transaction.commit();
  after_compact();
  return result;
}

// Passes all commits up to this one to `take`, in order, after checking their digests; a commit for which that
// returns false is damaged.
void SqlStore::for_each_commit(CommitId at, const TakeCommit& take) {
  Statement commits = database_.prepare(
      fmt::format("SELECT {} FROM commits WHERE id <= ?1 ORDER BY id", kCommitColumns));
  commits.bind_all(at.value);
  Statement rows = database_.prepare(
      "SELECT kind, object, value, commit_id FROM changes WHERE commit_id <= ?1 "
      "ORDER BY commit_id, number");
  rows.bind_all(at.value);
  bool more = rows.step();
  std::uint64_t expected = 0;
  while (commits.step()) {
    const AtlasCommit commit = commit_of(commits);
    if (expected != 0 && commit.id.value != expected) {
      fail_as_damaged(name(), fmt::format("the log: commit {} is missing; it", expected));
    }
    expected = commit.id.value + 1;
    std::vector<RowChange> changes;
    // Changes of a missing commit make the next commit's digest wrong.
    for (; more && rows.unsigned_integer(3) <= commit.id.value; more = rows.step()) {
      changes.push_back(change_of(rows));
    }
    const bool sound = as_text(commits.blob(8)) == commit_digest(commit, changes);
    if (!sound || !take(commit, changes)) {
      fail_as_damaged(name(), fmt::format("commit {}", commit.id.value));
    }
  }
}

RowValues SqlStore::read_values(CommitId at) {
  RowValues values;
  for_each_commit(at, [&](const AtlasCommit&, std::span<const RowChange> changes) {
    return std::all_of(changes.begin(), changes.end(),
                       [&](const RowChange& change) { return values.apply(change); });
  });
  return values;
}

AtlasState SqlStore::read_state(CommitId at) {
  const RowValues values = read_values(at);
  AtlasState state;
  state.commit = at;
  read_rows("nodes", kNodeColumns, values.nodes, [&](const Statement& row) {
    const AtlasNode node = node_of(row, name());
    state.nodes[node.id] = node;
  });
  read_rows("links", kLinkColumns, values.links, [&](const Statement& row) {
    const Link link = link_of(row, name());
    state.links[link.id] = link;
  });
  read_rows("poses", kPoseColumns, values.poses, [&](const Statement& row) {
    const AtlasPose pose = pose_of(row, name());
    state.poses[pose.node] = pose;
  });
  for (const auto& [link, agrees] : values.agrees) state.agrees[LinkId{link}] = agrees != 0;
  // Digests show that bytes were changed, not that a file from others makes sense.
  check_state(state, name(), ErrorKind::kInput);
  return state;
}

// Reads the rows that `values` name and passes each to `take`.
void SqlStore::read_rows(const char* table, const char* columns,
                         const std::map<std::uint64_t, std::uint64_t>& values,
                         const TakeRow& take) {
  if (values.empty()) return;
  std::set<std::uint64_t> wanted;
  for (const auto& [object, value] : values) wanted.insert(value);
  // One range query, because a query per row is slow with a remote database, and the range contains few
  // other rows.
  Statement row = database_.prepare(
      fmt::format("SELECT {} FROM {} WHERE id >= ?1 AND id <= ?2 ORDER BY id", columns, table));
  row.bind_all(*wanted.begin(), *wanted.rbegin());
  while (row.step()) {
    if (wanted.erase(row.unsigned_integer(0)) > 0) take(row);
  }
  if (!wanted.empty()) {
    fail_as_damaged(name(),
                    fmt::format("the table of {}: row {} is missing; it", table, *wanted.begin()));
  }
}

std::uint64_t SqlStore::next_id(const char* table, std::int64_t kind) {
  // Ids of dropped objects are not reused: the log or another process may name them.
  const std::int64_t of_rows =
      database_.integer(fmt::format("SELECT coalesce(max(id), 0) FROM {}", table));
  const std::int64_t of_changes =
      database_.integer(fmt::format("SELECT coalesce(max({}), 0) FROM changes WHERE kind = {}",
                                    kind == kPose ? "value" : "object", kind));
  return static_cast<std::uint64_t>(std::max(of_rows, of_changes)) + 1;
}

// Assigns ids to new objects and writes their rows. @return the changes for the log
std::vector<RowChange> SqlStore::write_objects(AtlasChanges& changes, AtlasCommitted& committed) {
  std::vector<RowChange> rows;
  const auto remove = [&](const auto& ids, RowKind kind) {
    for (const auto id : ids) rows.push_back({kind, id.value, std::nullopt});
  };
  remove(changes.removed_nodes, kNode);
  remove(changes.removed_links, kLink);
  remove(changes.removed_poses, kPose);
  remove(changes.removed_agrees, kAgrees);
  const auto write = [&](auto& objects, const char* table, RowKind kind, auto& added) {
    std::uint64_t next = objects.empty() ? 0 : next_id(table, kind);
    for (auto& object : objects) {
      if (object.id.value == 0) {
        object.id.value = next++;
        added.push_back(object.id);
        insert(object);
      } else {
        require_row(table, object.id.value);
      }
      rows.push_back({kind, object.id.value, object.id.value});
    }
  };
  write(changes.nodes, "nodes", kNode, committed.nodes);
  write(changes.links, "links", kLink, committed.links);
  std::uint64_t next = changes.poses.empty() ? 0 : next_id("poses", kPose);
  for (const AtlasPose& pose : changes.poses) {
    insert(pose, next);
    rows.push_back({kPose, pose.node.value, next++});
  }
  for (const auto& [id, agrees] : changes.agrees) {
    rows.push_back({kAgrees, id.value, agrees ? 1U : 0U});
  }
  return rows;
}

// A row that is restored may have been dropped by compact().
void SqlStore::require_row(const char* table, std::uint64_t id) {
  Statement row = database_.prepare(fmt::format("SELECT 1 FROM {} WHERE id = ?1", table));
  if (row.bind_all(id).step()) return;
  throw Error(ErrorKind::kMisuse, name(),
              fmt::format("row {} of its {} to be restored is not stored", id, table),
              "one that no compaction dropped");
}

template <class... Values>
void SqlStore::insert_row(const char* table, const char* columns, const Values&... values) {
  std::string places;
  for (std::size_t i = 1; i <= sizeof...(values); ++i) {
    places += fmt::format("{}?{}", i > 1 ? ", " : "", i);
  }
  database_.run(fmt::format("INSERT INTO {} ({}) VALUES ({})", table, columns, places), values...);
}

void SqlStore::insert(const AtlasNode& node) {
  const auto key = bytes_of_hexadecimal(node.map);
  Statement known = database_.prepare("SELECT 1 FROM maps WHERE hash = ?1");
  refuse_if(!key || !known.bind_all(as_blob(*key)).step(), "AtlasNode.map", printable(node.map),
            "the hash that put_map() gave");
  insert_row("nodes", kNodeColumns, node.id.value, node.name, node.session, as_blob(*key),
             static_cast<std::int64_t>(node.length_unit), node.frames, node.landmarks,
             node.observations, as_blob(extent_bytes(node.extent)), as_blob(digest_of(node)));
}

void SqlStore::insert(const Link& link) {
  using Blob = std::optional<std::span<const std::byte>>;
  const LinkBlobs blobs = blobs_of(link);
  const auto or_null = [](const std::string& bytes) {
    return bytes.empty() ? Blob() : Blob(as_blob(bytes));
  };
  const bool sound =
      (!link.target_from_source || pose_of_bytes(blobs.target_from_source)) &&
      (!link.covariance || covariance6_of_bytes(blobs.covariance)) &&
      (!link.covariance_with_scale || covariance7_of_bytes(blobs.covariance_with_scale));
  refuse_if(!sound, "Link", "a transform or covariance that is none",
            "finite numbers and a positive semidefinite covariance");
  insert_row("links", kLinkColumns, link.id.value, link.target.value, link.source.value,
             static_cast<std::int64_t>(link.kind), static_cast<std::int64_t>(stored_verdict(link)),
             link.probability, link.reason, or_null(blobs.target_from_source),
             or_null(blobs.covariance), or_null(blobs.covariance_with_scale),
             as_blob(digest_of(link, blobs)));
}

void SqlStore::insert(const AtlasPose& pose, std::uint64_t row) {
  const PoseBlobs blobs = blobs_of(pose);
  refuse_if(!pose_of_bytes(blobs.frame_from_node) || !covariance7_of_bytes(blobs.covariance),
            "AtlasPose", "a pose or covariance that is none",
            "finite numbers and a positive semidefinite covariance");
  insert_row("poses", kPoseColumns, row, pose.node.value, pose.frame.value,
             as_blob(blobs.frame_from_node), as_blob(blobs.covariance),
             as_blob(digest_of(pose, row, blobs)));
}

void SqlStore::write_commit(const AtlasCommit& commit, std::span<const RowChange> changes) {
  insert_row("commits", kCommitColumns, commit.id.value, commit.time_ms, commit.author, commit.host,
             commit.verb, commit.text,
             commit.undoes ? std::optional(commit.undoes->value) : std::nullopt, commit.run.value,
             as_blob(commit_digest(commit, changes)));
  Statement insert = database_.prepare("INSERT INTO changes VALUES (?1, ?2, ?3, ?4, ?5)");
  for (std::size_t i = 0; i < changes.size(); ++i) {
    insert.run(commit.id.value, i, changes[i].kind, changes[i].object, changes[i].value);
  }
}

}  // namespace cairn::detail
