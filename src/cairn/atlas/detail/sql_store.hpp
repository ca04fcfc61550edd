// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "cairn/atlas/detail/change_log.hpp"
#include "cairn/atlas/store/store.hpp"
#include "cairn/storage/database.hpp"

namespace cairn::detail {

using storage::Statement;

/// Largest size of the pieces in which maps are stored. Databases limit values to 1 GB; smaller
/// values need less memory at a time.
inline constexpr std::size_t kChunkBytes = std::size_t{4} << 20;

inline constexpr const char* kNodeColumns =
    "id, name, session, map, length_unit, frames, landmarks, observations, extent, digest";
inline constexpr const char* kLinkColumns =
    "id, target, source, kind, verdict, probability, reason, target_from_source, covariance, "
    "covariance_with_scale, digest";
inline constexpr const char* kPoseColumns = "id, node, frame, frame_from_node, covariance, digest";

// Read an object from a row with these columns; `name` is the store's name.
// @throws Error (input) naming the row if its digest or a value is wrong
AtlasNode node_of(const Statement& row, const std::string& name);
Link link_of(const Statement& row, const std::string& name);
AtlasPose pose_of(const Statement& row, const std::string& name);
/// The change in a row with the columns kind, object and value.
RowChange change_of(const Statement& row);

/// The store of an atlas in an SQL database.
class SqlStore : public AtlasStore {
 public:
  SqlStore(storage::Database database, AtlasStoreOptions options)
      : database_(std::move(database)), options_(std::move(options)) {}

  const std::string& name() const override { return database_.name(); }
  CommitId last_commit() override;
  AtlasState state(std::optional<CommitId> at) override;
  std::vector<AtlasCommit> log() override;
  AtlasTouched touched(std::span<const CommitId> commits) override;
  std::string put_map(std::string_view bytes) override;
  std::string map_bytes(const std::string& hash) override;
  AtlasCommitted commit(const AtlasCommitInfo& info, const Make& make) override;
  AtlasVerification verify() override;
  AtlasCompaction compact(std::uint64_t keep, bool dry) override;

 protected:
  /// Looks for damage in the database's files. The default does nothing, because a server manages
  /// its files itself.
  virtual void check_files(std::vector<std::string>& problems) { (void)problems; }
  /// Frees space.
  virtual void after_compact() {}

  storage::Database& database() { return database_; }
  const AtlasStoreOptions& options() const { return options_; }

 private:
  using TakeCommit = std::function<bool(const AtlasCommit&, std::span<const RowChange>)>;
  using TakeRow = std::function<void(const Statement&)>;

  void for_each_commit(CommitId at, const TakeCommit& take);
  RowValues read_values(CommitId at);
  AtlasState read_state(CommitId at);
  void read_rows(const char* table, const char* columns,
                 const std::map<std::uint64_t, std::uint64_t>& values, const TakeRow& take);
  std::uint64_t next_id(const char* table, std::int64_t kind);
  std::uint64_t first_commit();  // 0 if there is none
  void count_rows(AtlasVerification& result);
  std::uint64_t bytes_of_maps(const std::string& where = {});
  std::vector<RowChange> write_objects(AtlasChanges& changes, AtlasCommitted& committed);
  void require_row(const char* table, std::uint64_t id);
  template <class... Values>
  void insert_row(const char* table, const char* columns, const Values&... values);
  void insert(const AtlasNode& node);
  void insert(const Link& link);
  void insert(const AtlasPose& pose, std::uint64_t row);
  void write_commit(const AtlasCommit& commit, std::span<const RowChange> changes);

  storage::Database database_;
  AtlasStoreOptions options_;
  std::optional<AtlasState> newest_;
};

}  // namespace cairn::detail
