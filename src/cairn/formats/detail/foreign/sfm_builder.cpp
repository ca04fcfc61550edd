// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/detail/foreign/sfm_builder.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/formats/detail/foreign/written_frames.hpp"
#include "cairn/formats/detail/losses.hpp"
#include "cairn/formats/detail/memory_budget.hpp"

namespace cairn::detail {
namespace {

constexpr std::uint32_t kNoRow = std::numeric_limits<std::uint32_t>::max();

// The rows of a column of ids in ascending order; equal ids keep theirs.
template <class Id>
std::vector<std::uint32_t> rows_by_id(const std::vector<Id>& ids) {
  std::vector<std::uint32_t> rows(ids.size());
  std::iota(rows.begin(), rows.end(), 0U);
  if (std::is_sorted(ids.begin(), ids.end())) return rows;
  std::stable_sort(rows.begin(), rows.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return ids[a] < ids[b]; });
  return rows;
}

// Writes an entry of a column that stays empty until the first known value.
template <class Column, class Value>
void append_if_known(Column& column, std::size_t row, const std::optional<Value>& value) {
  if (!value && column.empty()) return;
  column.resize(row);
  column.push_back(value);
}

template <class Column>
void permute(Column& column, const std::vector<std::size_t>& order) {
  if (column.empty()) return;
  Column result;
  result.reserve(order.size());
  for (const std::size_t i : order) result.push_back(std::as_const(column)[i]);
  column = std::move(result);
}

// The entries by `key_of(entry)`, below `keys`; those of one key keep their order, those of key kNoRow are left out.
// @param offsets where the entries of each key begin, and the end
template <class KeyOf>
std::vector<std::size_t> by_key(const std::vector<std::size_t>& entries, std::size_t keys,
                                const KeyOf& key_of, std::vector<std::uint64_t>& offsets) {
  offsets.assign(keys + 1, 0);
  for (const std::size_t i : entries) {
    if (key_of(i) != kNoRow) ++offsets[key_of(i) + 1];
  }
  std::partial_sum(offsets.begin(), offsets.end(), offsets.begin());
  std::vector<std::uint64_t> next(offsets.begin(), offsets.end() - 1);
  std::vector<std::size_t> sorted(offsets.back());
  for (const std::size_t i : entries) {
    if (key_of(i) != kNoRow) sorted[next[key_of(i)]++] = i;
  }
  return sorted;
}

}  // namespace

SfmFrame frame_from_inverse(FrameId id, const Eigen::Quaterniond& camera_from_world,
                            const Eigen::Vector3d& translation) {
  const Eigen::Quaterniond q = camera_from_world.conjugate();
  return {.id = id, .world_from_camera = q, .centre = -(q * translation)};
}

void SfmBuilder::remark(std::string_view text) const {
  log_remark(execution_.log, name_, text);
}

void SfmBuilder::lost(std::string_view text) const {
  log_remark(execution_.log, name_, text, RemarkKind::kLoss);
}

void SfmBuilder::lost(std::size_t count, std::string_view text) const {
  if (count > 0) lost(fmt::format("{} {}", count, text));
}

void SfmBuilder::add_camera(const std::string& key, std::optional<Camera> camera,
                            std::string defect) {
  if (defect.empty() && camera) defect = camera_defect(*camera);
  if (!defect.empty()) lost(fmt::format("camera {} is unknown to the map: {}", key, defect));
  if (!defect.empty() || !camera) {
    cameras_.emplace(key, std::nullopt);
    return;
  }
  if (first_pixel_ != 0.0) shift_centre(*camera, -first_pixel_);
  cameras_.emplace(key, CameraIndex{static_cast<std::uint32_t>(tables_.cameras.size())});
  tables_.cameras.push_back(std::move(*camera));
}

std::optional<CameraIndex> SfmBuilder::camera(const std::string& key) const {
  const auto found = cameras_.find(key);
  return found == cameras_.end() ? std::nullopt : found->second;
}

FrameIndex SfmBuilder::add_frame(SfmFrame frame) {
  FrameTable& frames = tables_.frames;
  const std::size_t row = frames.ids.size();
  const Eigen::Quaterniond& q = frame.world_from_camera;
  frames.ids.push_back(frame.id);
  frames.quaternions.push_back({q.w(), q.x(), q.y(), q.z()});
  frames.translations.push_back(frame.centre);
  frames.cameras.push_back(frame.camera);
  frames.image_names.push_back(std::move(frame.image_name));
  frames.timestamps_s.push_back(frame.timestamp_s);
  frames.gnss.push_back(frame.gnss);
  return FrameIndex{static_cast<std::uint32_t>(row)};
}

void SfmBuilder::add_landmark(std::uint64_t id, const Eigen::Vector3d& position,
                              const std::optional<Color>& color) {
  LandmarkTable& landmarks = tables_.landmarks;
  append_if_known(landmarks.colors, landmarks.ids.size(), color);
  landmarks.ids.push_back(LandmarkId{id});
  landmarks.positions.push_back(position);
}

void SfmBuilder::reserve(std::size_t landmarks) {
  tables_.landmarks.ids.reserve(landmarks);
  tables_.landmarks.positions.reserve(landmarks);
  tables_.landmarks.colors.reserve(landmarks);
}

void SfmBuilder::set_descriptors(std::string kind, std::size_t bytes_each, DescriptorNorm norm) {
  descriptor_kind_ = std::move(kind);
  bytes_each_ = bytes_each;
  norm_ = norm;
}

void SfmBuilder::add_observation(const SfmObservation& observation) {
  ObservationTable& table = tables_.observations;
  const std::size_t row = table.frames.size();
  observed_ids_.push_back(observation.landmark_id);
  table.frames.push_back(observation.frame);
  table.pixels.push_back({observation.pixel.u - first_pixel_, observation.pixel.v - first_pixel_});
  append_if_known(table.keypoints, row, observation.keypoint);
  append_if_known(table.depths, row, observation.depth);
  append_if_known(table.octaves, row, observation.octave);
  if (bytes_each_ == 0) return;
  descriptors_.insert(descriptors_.end(), observation.descriptor.begin(),
                      observation.descriptor.end());
  descriptor_ends_.push_back(descriptors_.size());
}

// Rigs of one camera each say nothing that the cameras do not.
void SfmBuilder::set_instants() {
  const bool is_plain = std::all_of(tables_.rigs.begin(), tables_.rigs.end(),
                                    [](const Rig& rig) { return rig.mounts.size() < 2; });
  if (is_plain) {
    tables_.rigs.clear();
    return;
  }
  constexpr double kTolerance = 1e-9;
  const auto from_rig = cameras_from_rigs(tables_.rigs);
  FrameTable& frames = tables_.frames;
  frames.instants.assign(frame_count(), std::nullopt);
  std::size_t unmounted = 0;
  std::size_t elsewhere = 0;
  double farthest = 0.0;
  for (const auto& [instant, frame, rig_from_world] : taken_) {
    const auto camera = frames.cameras[frame.value];
    const auto mount = camera ? from_rig.find(*camera) : from_rig.end();
    if (mount == from_rig.end()) {
      ++unmounted;
      continue;
    }
    frames.instants[frame.value] = instant;
    const auto& q = frames.quaternions[frame.value];
    const Rigid3 stated(Eigen::Quaterniond(q[0], q[1], q[2], q[3]),
                        frames.translations[frame.value]);
    const Rigid3 expected = (mount->second * rig_from_world).inverse();
    if (are_near(stated, expected, kTolerance)) continue;
    ++elsewhere;
    farthest = std::max(farthest, (stated.translation() - expected.translation()).norm());
  }
  lost(unmounted, "images of rigs have a camera that no rig states; they count as images alone");
  if (elsewhere > 0) {
    remark(
        fmt::format("{} of {} images of rigs are not where their rig has them, up to {:.3g} "
                    "away; they stay where they are",
                    elsewhere, taken_.size(), farthest));
  }
}

void SfmBuilder::sort_by_id() {
  const auto frames = rows_by_id(tables_.frames.ids);
  const auto landmarks = rows_by_id(tables_.landmarks.ids);
  if (std::is_sorted(frames.begin(), frames.end()) &&
      std::is_sorted(landmarks.begin(), landmarks.end())) {
    return;
  }
  // They are in no order yet, and keep it.
  ObservationTable observations = std::exchange(tables_.observations, {});
  reorder(tables_, frames, landmarks);
  tables_.observations = std::move(observations);
  std::vector<std::uint32_t> new_rows(frames.size());
  for (std::uint32_t i = 0; i < frames.size(); ++i) new_rows[frames[i]] = i;
  for (FrameIndex& frame : tables_.observations.frames) frame = FrameIndex{new_rows[frame.value]};
}

// The landmark of each observation; kNoRow if it is not there.
std::vector<std::uint32_t> SfmBuilder::landmark_rows() const {
  const std::vector<LandmarkId>& ids = tables_.landmarks.ids;
  const std::vector<std::uint32_t> order = rows_by_id(ids);
  std::vector<std::uint32_t> rows(observed_ids_.size(), kNoRow);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (i > 0 && observed_ids_[i] == observed_ids_[i - 1]) {
      rows[i] = rows[i - 1];
      continue;
    }
    const LandmarkId id{observed_ids_[i]};
    const auto found =
        std::lower_bound(order.begin(), order.end(), id,
                         [&](std::uint32_t row, LandmarkId sought) { return ids[row] < sought; });
    if (found != order.end() && ids[*found] == id) rows[i] = *found;
  }
  return rows;
}

// @return number of observations left out because their landmark is not there
std::size_t SfmBuilder::group_observations(bool by_frame) {
  ObservationTable& table = tables_.observations;
  const std::size_t count = table.frames.size();
  const auto complete = [&](auto& column) {
    if (!column.empty()) column.resize(count);
  };
  complete(table.keypoints);
  complete(table.depths);
  complete(table.octaves);
  const std::vector<std::uint32_t> rows = landmark_rows();
  observed_ids_ = {};
  std::vector<std::size_t> entries(count);
  std::iota(entries.begin(), entries.end(), std::size_t{0});
  if (by_frame) {
    std::vector<std::uint64_t> ignored;
    entries = by_key(
        entries, frame_count(), [&](std::size_t i) { return table.frames[i].value; }, ignored);
  }
  entries = by_key(
      entries, landmark_count(), [&](std::size_t i) { return rows[i]; }, table.offsets);
  if (entries.size() < count || !std::is_sorted(entries.begin(), entries.end())) {
    permute(table.frames, entries);
    permute(table.pixels, entries);
    permute(table.keypoints, entries);
    permute(table.depths, entries);
    permute(table.octaves, entries);
  }
  if (bytes_each_ > 0) choose_descriptors(entries);
  if (entries.empty()) table.offsets.clear();
  return count - entries.size();
}

// @param entries the places at which the observations, now grouped, were added
void SfmBuilder::choose_descriptors(const std::vector<std::size_t>& entries) {
  const std::vector<std::uint64_t>& offsets = tables_.observations.offsets;
  DescriptorColumn column{descriptor_kind_, bytes_each_, {}, {}};
  std::vector<std::span<const std::uint8_t>> of_landmark;
  for (std::size_t row = 0; row < landmark_count(); ++row) {
    of_landmark.clear();
    for (std::uint64_t k = offsets[row]; k < offsets[row + 1]; ++k) {
      const std::size_t begin = entries[k] == 0 ? 0 : descriptor_ends_[entries[k] - 1];
      if (begin == descriptor_ends_[entries[k]]) continue;
      of_landmark.push_back(std::span(descriptors_).subspan(begin, bytes_each_));
    }
    append_distinct(column, of_landmark, norm_);
  }
  if (std::find(column.known.begin(), column.known.end(), 1) != column.known.end()) {
    tables_.landmarks.descriptors = std::move(column);
  }
  descriptors_ = {};
  descriptor_ends_ = {};
}

LandmarkMap SfmBuilder::finish(const SfmEnd& end) && {
  LandmarkTable& landmarks = tables_.landmarks;
  if (!landmarks.colors.empty()) landmarks.colors.resize(landmarks.ids.size());
  set_instants();
  if (end.sort_by_id) sort_by_id();
  const std::size_t left_out = group_observations(end.observations_by_frame);
  if (!end.lost_observations.empty()) lost(left_out, end.lost_observations);
  tables_.info.length_unit = end.length_unit;
  return imported_map(std::move(tables_), name_, execution_.log, end.place);
}

void require_descriptor_budget(std::uint64_t descriptor_bytes, std::uint64_t file_bytes,
                               const std::string& name) {
  if (descriptor_bytes <= memory_budget(file_bytes)) return;
  throw Error(ErrorKind::kInput, name, fmt::format("descriptors take {} bytes", descriptor_bytes),
              "at most 32 times the bytes of the files and 64 MiB");
}

template <class Number>
void to_bytes(std::span<const Number> numbers, std::span<std::uint8_t> bytes) {
  const bool are_bytes = std::all_of(numbers.begin(), numbers.end(), [](Number x) {
    return x >= 0 && x <= 255 && x == std::floor(x);
  });
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const double value = std::isfinite(numbers[i]) ? double{numbers[i]} : 0.0;
    const double scaled = are_bytes ? value : 128.0 + 127.0 * value;
    bytes[i] = static_cast<std::uint8_t>(std::lround(std::clamp(scaled, 0.0, 255.0)));
  }
}
template void to_bytes(std::span<const float> numbers, std::span<std::uint8_t> bytes);
template void to_bytes(std::span<const double> numbers, std::span<std::uint8_t> bytes);

bool is_rotation(const Eigen::Matrix3d& matrix) {
  constexpr double kTolerance = 1e-3;
  const Eigen::Matrix3d off = matrix * matrix.transpose() - Eigen::Matrix3d::Identity();
  return off.cwiseAbs().maxCoeff() < kTolerance && matrix.determinant() > 0.0;
}

bool has_direction(const Eigen::Quaterniond& quaternion) {
  const double norm = quaternion.norm();
  return norm > 1e-6 && norm < 1e6;
}

Color color_of(const Eigen::Vector3d& rgb) {
  const auto channel = [&](int i) {
    return static_cast<std::uint8_t>(std::lround(std::clamp(rgb[i], 0.0, 255.0)));
  };
  return {channel(0), channel(1), channel(2)};
}

void shift_centre(Camera& camera, double by) {
  const auto& names = camera_model(camera.model)->parameters;
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (names[i] == "cx" || names[i] == "cy") camera.parameters[i] += by;
  }
}

bool is_file(const std::filesystem::path& path) {
  std::error_code ignored;
  return std::filesystem::is_regular_file(path, ignored);
}

}  // namespace cairn::detail
