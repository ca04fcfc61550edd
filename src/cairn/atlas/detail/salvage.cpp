// SPDX-License-Identifier: BSD-3-Clause
#include <limits>
#include <map>
#include <set>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "cairn/atlas/detail/sql_store.hpp"
#include "cairn/atlas/detail/stores.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"
#include "cairn/formats/map_file.hpp"

namespace cairn::detail {
namespace {

// Copies what is readable of a damaged atlas into a new one.
class Salvage {
 public:
  Salvage(const std::filesystem::path& from, const std::filesystem::path& to,
          const AtlasStoreOptions& options)
      : name_(from.string()),
        database_(open_sqlite_database(from, reading(options), false)),
        source_(open_sqlite_store(from, reading(options), false)) {
    read_log();
    create_sqlite_store(to, options);
    store_ = open_sqlite_store(to, options);
  }

  AtlasSalvage run() {
    take_maps();
    take_links_and_poses();
    return std::move(result_);
  }

 private:
  static AtlasStoreOptions reading(AtlasStoreOptions options) {
    options.read_only = true;
    return options;
  }

  void lose(const std::string& what) {
    if (result_.lost.size() < 1000) result_.lost.push_back(what);
  }

  // The last state, as far as the log is readable.
  void read_log() {
    try {
      Statement rows =
          database_.prepare("SELECT kind, object, value FROM changes ORDER BY commit_id, number");
      while (rows.step()) values_.apply(change_of(rows));
    } catch (const Error& error) {
      if (error.kind() == ErrorKind::kCancelled) throw;
      log_is_sound_ = false;
      lose(fmt::format("some of the log, so that what was removed may be there again: {}",
                       error.what()));
    }
  }

  bool was_there(const std::map<std::uint64_t, std::uint64_t>& of, std::uint64_t id) const {
    return !log_is_sound_ || of.contains(id);
  }

  // Reads rows one by one from both ends, to find those after a damaged page too.
  template <class Take>
  void each(const char* table, const char* columns, const Take& take) {
    std::set<std::int64_t> seen;
    bool cut_short = false;
    for (const bool ascending : {true, false}) {
      try {
        each_from_one_end(table, columns, ascending, seen, take);
        if (!cut_short) break;
      } catch (const Error& error) {
        if (error.kind() == ErrorKind::kCancelled) throw;
        if (!cut_short) lose(fmt::format("some of the {}: {}", table, error.what()));
        cut_short = true;
      }
    }
  }

  template <class Take>
  void each_from_one_end(const char* table, const char* columns, bool ascending,
                         std::set<std::int64_t>& seen, const Take& take) {
    std::int64_t after = ascending ? std::numeric_limits<std::int64_t>::min()
                                   : std::numeric_limits<std::int64_t>::max();
    Statement next = database_.prepare(
        ascending ? fmt::format("SELECT id FROM {} WHERE id > ?1 ORDER BY id LIMIT 1", table)
                  : fmt::format("SELECT id FROM {} WHERE id < ?1 ORDER BY id DESC LIMIT 1", table));
    while (next.bind_all(after).step()) {
      after = next.integer(0);
      next.reset();
      if (!seen.insert(after).second) break;
      try {
        Statement row =
            database_.prepare(fmt::format("SELECT {} FROM {} WHERE id = ?1", columns, table));
        if (row.bind_all(after).step()) take(row);
      } catch (const Error& error) {
        if (error.kind() == ErrorKind::kCancelled) throw;
        lose(fmt::format("{} {}: {}", table, after, error.what()));
      }
    }
  }

  void take_maps() {
    std::set<std::string> names;
    AtlasChanges changes;
    std::vector<NodeId> old_nodes;
    each("nodes", kNodeColumns, [&](const Statement& row) {
      AtlasNode node = node_of(row, name_);
      if (!was_there(values_.nodes, node.id.value)) return;
      const std::string bytes = source_->map_bytes(node.map);
      MemoryReader reader(bytes, fmt::format("map {}", node.name));
      read_binary(reader);
      store_->put_map(bytes);
      while (!names.insert(node.name).second) node.name += "~";
      old_nodes.push_back(node.id);
      node.id = NodeId{};
      changes.nodes.push_back(std::move(node));
    });
    changes.text = fmt::format("salvaged {} maps from {}", changes.nodes.size(), name_);
    const AtlasCommitted added = store_->commit(info_, [&](const AtlasState&) { return changes; });
    for (std::size_t i = 0; i < old_nodes.size(); ++i) new_of_old_[old_nodes[i]] = added.nodes[i];
    result_.maps = old_nodes.size();
    info_.run = added.commit;
  }

  void take_links_and_poses() {
    AtlasChanges changes;
    std::vector<LinkId> old_links;
    each("links", kLinkColumns, [&](const Statement& row) {
      Link link = link_of(row, name_);
      if (!was_there(values_.links, link.id.value)) return;
      if (!new_of_old_.contains(link.target) || !new_of_old_.contains(link.source)) return;
      old_links.push_back(link.id);
      link.id = LinkId{};
      link.target = new_of_old_[link.target];
      link.source = new_of_old_[link.source];
      changes.links.push_back(std::move(link));
    });
    take_poses(changes);
    result_.links = changes.links.size();
    result_.poses = changes.poses.size();
    changes.text = fmt::format("salvaged {} links and {} poses", result_.links, result_.poses);
    const AtlasCommitted linked = store_->commit(info_, [&](const AtlasState&) { return changes; });
    store_->commit(info_, [&](const AtlasState& now) {
      AtlasChanges agreements;
      for (std::size_t i = 0; i < old_links.size(); ++i) {
        const auto found = values_.agrees.find(old_links[i].value);
        if (found == values_.agrees.end()) continue;
        const bool agrees = found->second != 0;
        if (has_poses_of(now, linked.links[i], agrees)) {
          agreements.agrees.emplace_back(linked.links[i], agrees);
        }
      }
      agreements.text = fmt::format("salvaged {} agreements", agreements.agrees.size());
      return agreements;
    });
  }

  // The last poses, in frames of nodes that still have theirs.
  void take_poses(AtlasChanges& changes) {
    std::set<std::uint64_t> last_poses;
    for (const auto& [node, row] : values_.poses) last_poses.insert(row);
    each("poses", kPoseColumns, [&](const Statement& row) {
      AtlasPose pose = pose_of(row, name_);
      if (!log_is_sound_ || !last_poses.contains(row.unsigned_integer(0))) return;
      if (!new_of_old_.contains(pose.node) || !new_of_old_.contains(pose.frame)) return;
      pose.node = new_of_old_[pose.node];
      pose.frame = new_of_old_[pose.frame];
      changes.poses.push_back(pose);
    });
    std::set<NodeId> frames;
    for (const AtlasPose& pose : changes.poses) {
      if (pose.node == pose.frame) frames.insert(pose.frame);
    }
    std::erase_if(changes.poses,
                  [&](const AtlasPose& pose) { return !frames.contains(pose.frame); });
  }

  std::string name_;
  sqlite::Database database_;
  std::unique_ptr<AtlasStore> source_;
  std::unique_ptr<AtlasStore> store_;
  RowValues values_;
  bool log_is_sound_ = true;
  std::map<NodeId, NodeId> new_of_old_;
  AtlasCommitInfo info_{.verb = "salvage"};
  AtlasSalvage result_;
};

}  // namespace

AtlasSalvage salvage_sqlite_store(const std::filesystem::path& from,
                                  const std::filesystem::path& to,
                                  const AtlasStoreOptions& options) {
  return Salvage(from, to, options).run();
}

}  // namespace cairn::detail
