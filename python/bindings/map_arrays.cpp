// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <initializer_list>
#include <limits>
#include <map>
#include <numeric>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cairn/core/detail/memory.hpp"
#include "cairn/core/error.hpp"
#include "cairn/map/operations.hpp"

#include "bindings/maps.hpp"
#include "bindings/optional_columns.hpp"
#include "bindings/text.hpp"

namespace cairn::python {
namespace {

template <class Id>
std::vector<Id> ids_of(py::handle given, std::string_view name, std::size_t count) {
  std::vector<Id> ids;
  detail::reserve_populated(ids, count);
  ids.resize(count);
  if (given.is_none()) {
    for (std::size_t i = 0; i < count; ++i) ids[i] = Id{i};
    return ids;
  }
  const auto array = id_array(given, name, {static_cast<py::ssize_t>(count)});
  for (std::size_t i = 0; i < count; ++i) ids[i] = Id{array.data()[i]};
  return ids;
}

DescriptorColumn descriptors_of(py::handle given, const std::string& kind, std::size_t count) {
  if (kind.empty()) {
    throw Error(
        ErrorKind::kMisuse, "descriptor_kind", "not given beside descriptors",
        "their kind, such as 'ORB' or 'SIFT'; maps are compared by descriptors of one kind");
  }
  DescriptorColumn column;
  column.kind = kind;
  const auto array =
      byte_array(given, "descriptors", {static_cast<py::ssize_t>(count), -1}, Masked::kUnknown);
  column.bytes_each = static_cast<std::size_t>(array.shape(1));
  column.bytes.assign(array.data(), array.data() + array.size());
  column.known = known_rows(given, count);
  for (std::size_t i = 0; i < count; ++i) {
    std::uint8_t* const bytes = column.bytes.data() + i * column.bytes_each;
    if (column.known[i] == 0) std::fill_n(bytes, column.bytes_each, std::uint8_t{0});
  }
  return column;
}

void add_further(std::optional<DescriptorColumn>& column, py::handle further, py::handle offsets,
                 std::size_t count) {
  if (further.is_none() && offsets.is_none()) return;
  if (further.is_none() || offsets.is_none() || !column) {
    throw py::value_error(
        "further_descriptors: expected together with descriptors and further_descriptor_offsets");
  }
  const auto bytes = byte_array(further, "further_descriptors",
                                {-1, static_cast<py::ssize_t>(column->bytes_each)});
  column->further.assign(bytes.data(), bytes.data() + bytes.size());
  const auto begins =
      id_array(offsets, "further_descriptor_offsets", {static_cast<py::ssize_t>(count) + 1});
  column->further_offsets.assign(begins.data(), begins.data() + begins.size());
}

// From an array of n matrices.
std::vector<Eigen::Matrix3d> covariances_of(py::handle given, std::size_t count) {
  const auto array =
      real_array(given, "covariances", {static_cast<py::ssize_t>(count), 3, 3}, Masked::kUnknown);
  std::vector<Eigen::Matrix3d> matrices;
  detail::reserve_populated(matrices, count);
  using RowMajor = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
  for (std::size_t i = 0; i < count; ++i)
    matrices.emplace_back(Eigen::Map<const RowMajor>(array.data() + 9 * i));
  return matrices;
}

// The keywords of from_arrays(): arrays and lists by name, and texts.
struct GivenArrays {
  std::map<std::string, py::object> arrays;
  std::string descriptor_kind;
  std::string length_unit = "metres";

  /// None if it was not given.
  py::object operator[](const std::string& name) const {
    const auto found = arrays.find(name);
    return found == arrays.end() ? py::none() : found->second;
  }
  /// @throws Error (misuse) if one of these was given without `beside`
  void refuse(std::initializer_list<const char*> names, const char* without,
              const char* beside) const {
    for (const char* const name : names) {
      if ((*this)[name].is_none()) continue;
      throw Error(ErrorKind::kMisuse, name, fmt::format("given without {}", without),
                  fmt::format("{} beside it", beside));
    }
  }
};

void fill_frames(MapTables& tables, const GivenArrays& given) {
  FrameTable& frames = tables.frames;
  const py::object poses = given["frame_poses"];
  const py::object timestamps = given["timestamps_s"];
  const py::object cameras = given["frame_cameras"];
  const py::object image_names = given["image_names"];
  if (poses.is_none()) {
    return given.refuse({"frame_ids", "timestamps_s", "frame_cameras", "image_names"},
                        "frame_poses", "frame_poses");
  }
  for (const Rigid3& pose : rigids_of(poses, "frame_poses")) {
    const Eigen::Quaterniond q = pose.quaternion();
    frames.translations.push_back(pose.translation());
    frames.quaternions.push_back({q.w(), q.x(), q.y(), q.z()});
  }
  const std::size_t count = frames.translations.size();
  frames.ids = ids_of<FrameId>(given["frame_ids"], "frame_ids", count);
  const auto size = static_cast<py::ssize_t>(count);
  if (!timestamps.is_none()) {
    frames.timestamps_s =
        from_nan(real_array(timestamps, "timestamps_s", {size}, Masked::kUnknown));
  }
  if (!cameras.is_none()) {
    const auto indices = integer_array(cameras, "frame_cameras", {size}, Masked::kUnknown);
    frames.cameras =
        from_masked<CameraIndex>(cameras, indices, [&](const std::int64_t* at, std::size_t i) {
          if (*at < 0 || *at >= static_cast<std::int64_t>(tables.cameras.size())) {
            throw Error(ErrorKind::kMisuse, fmt::format("frame_cameras[{}]", i),
                        fmt::format("{}", *at),
                        fmt::format("an index of the {} cameras", tables.cameras.size()));
          }
          return CameraIndex{static_cast<std::uint32_t>(*at)};
        });
  }
  if (!image_names.is_none()) {
    frames.image_names = encoded_each(image_names, "image_names");
    refuse_if(frames.image_names.size() != count, "image_names",
              fmt::format("{} names", frames.image_names.size()), fmt::format("{}", count));
  }
}

// The entries of an optional integer column of the observations, in the order of `order`.
template <class Integer>
OptionalColumn<Integer> integer_column(py::handle given, const char* name,
                                       const std::vector<std::size_t>& order) {
  if (given.is_none()) return {};
  const auto array =
      integer_array(given, name, {static_cast<py::ssize_t>(order.size())}, Masked::kUnknown);
  using Limits = std::numeric_limits<Integer>;
  const auto column =
      from_masked<Integer>(given, array, [&](const std::int64_t* at, std::size_t i) {
        if (*at < Limits::lowest() || *at > Limits::max()) {
          throw Error(ErrorKind::kMisuse, fmt::format("{}[{}]", name, i), fmt::format("{}", *at),
                      fmt::format("{} to {}", Limits::lowest(), Limits::max()));
        }
        return static_cast<Integer>(*at);
      });
  OptionalColumn<Integer> sorted(order.size());
  for (std::size_t i = 0; i < order.size(); ++i) sorted[i] = column[order[i]];
  return sorted;
}

void fill_observations(MapTables& tables, const GivenArrays& given) {
  const py::object landmarks = given["observed_landmarks"];
  const py::object frames = given["observing_frames"];
  const py::object pixels = given["pixels"];
  if (landmarks.is_none() && frames.is_none() && pixels.is_none()) {
    return given.refuse({"keypoints", "depths", "octaves", "sigmas_px"}, "observations",
                        "observed_landmarks");
  }
  refuse_if(landmarks.is_none() || frames.is_none() || pixels.is_none(),
            "observed_landmarks, observing_frames, pixels", "not all given", "all three or none");
  const auto of = integer_array(landmarks, "observed_landmarks", {-1});
  const auto size = of.shape(0);
  const auto by = integer_array(frames, "observing_frames", {size});
  const auto at = real_array(pixels, "pixels", {size, 2});
  const auto count = static_cast<std::size_t>(size);
  const std::size_t landmark_count = tables.landmarks.ids.size();
  const std::size_t frame_count = tables.frames.ids.size();
  ObservationTable& table = tables.observations;
  table.offsets.assign(landmark_count + 1, 0);
  const auto check = [](const char* name, std::size_t i, std::int64_t index, std::size_t end) {
    if (index < 0 || static_cast<std::uint64_t>(index) >= end) {
      throw Error(ErrorKind::kMisuse, fmt::format("{}[{}]", name, i), fmt::format("{}", index),
                  fmt::format("an index below {}", end));
    }
  };
  for (std::size_t i = 0; i < count; ++i) {
    check("observed_landmarks", i, of.data()[i], landmark_count);
    check("observing_frames", i, by.data()[i], frame_count);
    ++table.offsets[static_cast<std::size_t>(of.data()[i]) + 1];
  }
  std::partial_sum(table.offsets.begin(), table.offsets.end(), table.offsets.begin());
  // Grouped by landmark, in the order given within each.
  std::vector<std::size_t> order(count);
  std::vector<std::uint64_t> next(table.offsets.begin(), table.offsets.end() - 1);
  for (std::size_t i = 0; i < count; ++i) order[next[static_cast<std::size_t>(of.data()[i])]++] = i;
  table.frames.resize(count);
  table.pixels.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t from = order[i];
    table.frames[i] = FrameIndex{static_cast<std::uint32_t>(by.data()[from])};
    table.pixels[i] = {at.data()[2 * from], at.data()[2 * from + 1]};
  }
  table.keypoints = integer_column<std::uint32_t>(given["keypoints"], "keypoints", order);
  table.octaves = integer_column<std::int32_t>(given["octaves"], "octaves", order);
  const auto fill = [&](const char* name, OptionalColumn<double>& values) {
    const py::object numbers = given[name];
    if (numbers.is_none()) return;
    const auto column = from_nan(real_array(numbers, name, {size}, Masked::kUnknown));
    values.resize(count);
    for (std::size_t i = 0; i < count; ++i) values[i] = column[order[i]];
  };
  fill("depths", table.depths);
  fill("sigmas_px", table.sigmas_px);
}

Keywords<GivenArrays> from_arrays_keywords() {
  Keywords<GivenArrays> keywords("from_arrays");
  const auto add = [&](std::initializer_list<const char*> names) {
    for (const char* const name : names) {
      keywords.add(name, py::none(), [name](GivenArrays& given, py::handle value) {
        given.arrays[name] = py::reinterpret_borrow<py::object>(value);
      });
    }
  };
  add({"covariances", "ids", "colors", "descriptors"});
  keywords.add("descriptor_kind", [](auto& given) -> auto& { return given.descriptor_kind; });
  add({"further_descriptors", "further_descriptor_offsets", "columns", "cameras", "frame_poses",
       "frame_ids", "timestamps_s", "frame_cameras", "image_names", "observed_landmarks",
       "observing_frames", "pixels", "keypoints", "depths", "octaves", "sigmas_px"});
  keywords.add("length_unit", [](auto& given) -> auto& { return given.length_unit; });
  add({"world_frame", "gravity", "provenance"});
  return keywords;
}

constexpr const char* kFromArrays =
    R"(Makes a map from NumPy arrays. Columns that are not given are absent from the map.

positions            (n, 3), in the world frame
covariances          (n, 3, 3), of the positions; NaN where unknown
ids                  (n,), distinct; 0, 1, ... if left out
colors               (n, 3) uint8, red, green and blue; masked where unknown
descriptors          (n, b) uint8; masked where unknown
descriptor_kind      their kind, such as 'ORB' or 'SIFT'; required beside descriptors
further_descriptors  (m, b) uint8, of other views: those of landmark i are rows
                     further_descriptor_offsets[i] to below [i + 1] of (n + 1,)
columns              {name: (n,)}, further numbers per landmark under any name
cameras              list of Camera
frame_poses          (f, 4, 4), world_from_camera of the keyframes
frame_cameras        (f,), indices of cameras; masked where unknown
observed_landmarks   (o,), landmark index of each observation, in any order
observing_frames     (o,), frame index of each observation
pixels               (o, 2)
keypoints, depths, octaves  (o,)
sigmas_px            (o,), standard deviations of the pixels; NaN where unknown
length_unit          'metres' or 'free'
gravity              (3,), downward direction in the world frame

Raises MisuseError or InputError naming the invalid argument or entry.)";

SharedMap from_arrays(const py::object& positions, const py::kwargs& keywords) {
  const GivenArrays given = from_arrays_keywords().read(keywords);
  MapTables tables;
  tables.info.length_unit = length_unit_of(given.length_unit);
  const py::object world_frame = given["world_frame"];
  if (!world_frame.is_none()) tables.info.world_frame = encoded(world_frame, "world_frame");
  const py::object provenance = given["provenance"];
  if (!provenance.is_none()) tables.info.provenance = encoded_each(provenance, "provenance");
  if (const py::object gravity = given["gravity"]; !gravity.is_none()) {
    const auto down = real_array(gravity, "gravity", {3});
    tables.info.gravity = Eigen::Vector3d(down.at(0), down.at(1), down.at(2));
  }
  if (const py::object cameras = given["cameras"]; !cameras.is_none()) {
    for (const py::handle camera : py::iter(cameras)) {
      if (!py::isinstance<Camera>(camera))
        throw py::type_error("cameras: expected a list of Camera");
      tables.cameras.push_back(camera.cast<const Camera&>());
    }
  }

  LandmarkTable& landmarks = tables.landmarks;
  landmarks.positions = positions_of(positions, "positions");
  const std::size_t count = landmarks.positions.size();
  const auto size = static_cast<py::ssize_t>(count);
  landmarks.ids = ids_of<LandmarkId>(given["ids"], "ids", count);
  const py::object covariances = given["covariances"];
  if (!covariances.is_none()) landmarks.covariances = covariances_of(covariances, count);
  if (const py::object colors = given["colors"]; !colors.is_none()) {
    landmarks.colors =
        from_masked<Color>(colors, byte_array(colors, "colors", {size, 3}, Masked::kUnknown),
                           [](const std::uint8_t* rgb, std::size_t) {
                             return Color{rgb[0], rgb[1], rgb[2]};
                           });
  }
  if (const py::object descriptors = given["descriptors"]; !descriptors.is_none()) {
    landmarks.descriptors = descriptors_of(descriptors, given.descriptor_kind, count);
  }
  add_further(landmarks.descriptors, given["further_descriptors"],
              given["further_descriptor_offsets"], count);
  if (const py::object columns = given["columns"]; !columns.is_none()) {
    if (!py::isinstance<py::dict>(columns))
      throw py::type_error("columns: expected a dictionary of arrays");
    for (const auto& [name, values] : columns.cast<py::dict>()) {
      if (!py::isinstance<py::str>(name)) throw py::type_error("columns: expected names as keys");
      const auto text = name.cast<std::string>();
      const auto array =
          real_array(values, fmt::format("columns['{}']", text), {size}, Masked::kUnknown);
      landmarks.columns.push_back(
          {text, std::vector<double>(array.data(), array.data() + array.size())});
    }
  }
  fill_frames(tables, given);
  fill_observations(tables, given);
  return unlocked([&] { return std::make_shared<LandmarkMap>(std::move(tables)); });
}

// The features of one image for with_descriptors().
class GivenFeatures {
 public:
  GivenFeatures(const py::object& given, std::string place) : place_(std::move(place)) {
    const py::array array = py::array::ensure(given);
    are_bytes_ = array && array.dtype().kind() == 'u' && array.itemsize() == 1;
    if (are_bytes_) {
      bytes_ = byte_array(given, place_, {-1, -1});
    } else {
      numbers_ = real_array(given, place_, {-1, -1});
    }
    refuse_if(columns() == 0, place_, "descriptors of no numbers",
              "at least one for each keypoint");
  }

  std::size_t columns() const {
    return static_cast<std::size_t>(are_bytes_ ? bytes_.shape(1) : numbers_.shape(1));
  }

  void set(ModelDescriptors& landmarks, FrameIndex frame) const {
    const auto rows = static_cast<std::size_t>(are_bytes_ ? bytes_.shape(0) : numbers_.shape(0));
    for (const auto& wanted : landmarks.wanted(frame)) {
      if (wanted.keypoint >= rows) {
        throw Error(ErrorKind::kMisuse, place_, fmt::format("{} features", rows),
                    fmt::format("keypoint {}, which the map observes", wanted.keypoint));
      }
      const std::size_t begin = wanted.keypoint * columns();
      if (are_bytes_) {
        landmarks.set(wanted, std::span(bytes_.data() + begin, columns()));
      } else {
        const double* const row = numbers_.data() + begin;
        const std::vector<float> values(row, row + columns());
        landmarks.set(wanted, std::span<const float>(values));
      }
    }
  }

 private:
  std::string place_;
  bool are_bytes_ = false;
  py::array_t<std::uint8_t> bytes_;
  py::array_t<double> numbers_;
};

SharedMap with_descriptors(const SharedMap& map, const std::string& kind,
                           const py::function& features) {
  const auto& names = map->frames().image_names;
  refuse_if(kind.empty(), "kind", "is empty", "a kind of descriptors, such as 'SUPERPOINT'");
  if (names.empty() || map->observations().keypoints.empty()) {
    throw Error(
        ErrorKind::kMisuse, "map",
        names.empty() ? "has no names of images" : "does not know the keypoints it observes",
        "a map whose observations state image and keypoint, such as a COLMAP model");
  }
  ModelDescriptors landmarks(*map);
  std::size_t columns = 0;
  for (std::uint32_t i = 0; i < map->frame_count(); ++i) {
    if (landmarks.wanted(FrameIndex{i}).empty()) continue;
    const py::object given = features(decoded(names[i]));
    if (given.is_none()) continue;
    const GivenFeatures of_image(given, fmt::format("features({})", printable(names[i])));
    if (columns == 0) columns = of_image.columns();
    if (of_image.columns() != columns) {
      throw Error(ErrorKind::kMisuse, fmt::format("features({})", printable(names[i])),
                  fmt::format("descriptors of {} numbers", of_image.columns()),
                  fmt::format("{} as of other images", columns));
    }
    of_image.set(landmarks, FrameIndex{i});
  }
  auto column = landmarks.column(kind, columns);
  refuse_if(!column, "features", "describes no keypoint that the map observes",
            "an array for at least one image");
  LandmarkMap copy = *map;
  MapTables tables = std::move(copy).tables();
  tables.landmarks.descriptors = std::move(column);
  return std::make_shared<LandmarkMap>(std::move(tables));
}

}  // namespace

py::array_t<std::uint8_t> bytes_of_floats(const py::object& values) {
  const auto given = real_array(values, "values", {-1, -1});
  const auto columns = static_cast<std::size_t>(given.shape(1));
  py::array_t<std::uint8_t> result({given.shape(0), given.shape(1)});
  std::vector<float> row(columns);
  for (py::ssize_t i = 0; i < given.shape(0); ++i) {
    std::transform(given.data(i), given.data(i) + columns, row.begin(),
                   [](double value) { return static_cast<float>(value); });
    if (std::all_of(row.begin(), row.end(), [](float value) { return value == 0.0F; })) {
      throw Error(ErrorKind::kInput, fmt::format("values[{}]", i), "is all zero",
                  "a descriptor with a direction");
    }
    const std::vector<std::uint8_t> bytes = descriptor_bytes(row);
    std::copy(bytes.begin(), bytes.end(), result.mutable_data(i));
  }
  return result;
}

void bind_from_arrays(MapClass& map) {
  map.def(
      "with_descriptors", &with_descriptors, py::arg("kind"), py::arg("features"),
      "with_descriptors($self, kind, features)\n--\n\nThe map with descriptors of its images' "
      "features: those of each landmark's first eight\nobservations.\n\nkind      their kind, "
      "such as 'SUPERPOINT'; maps are compared by descriptors of one kind\nfeatures  called with "
      "the name of an image; returns its descriptors in the order of the\n          "
      "observations' keypoints, (n, d) uint8 or real numbers, or None. Real numbers are\n"
      "          compared by their directions.\n\nRaises MisuseError if the map observes a "
      "keypoint that an image lacks.");
  map.def_static("descriptor_bytes", &bytes_of_floats, py::arg("values"),
                 "descriptor_bytes(values)\n--\n\nBytes that stand for descriptors of "
                 "floating-point numbers, such as "
                 "SuperPoint's, which are\ncompared by their directions: (n, d) real numbers to "
                 "(n, d) uint8, for "
                 "from_arrays().");
  map.def_static("from_arrays", &from_arrays, py::arg("positions"),
                 kept(from_arrays_keywords().signature("positions", false) + kFromArrays));
}

}  // namespace cairn::python
