// SPDX-License-Identifier: BSD-3-Clause
#include "bindings/maps.hpp"

#include <filesystem>
#include <limits>
#include <span>

#include <fmt/format.h>

#include "cairn/core/detail/memory.hpp"
#include "cairn/formats/camera_file.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/map/synthetic.hpp"

#include "bindings/optional_columns.hpp"
#include "bindings/properties.hpp"
#include "bindings/text.hpp"

namespace cairn::python {

std::string_view to_string(LengthUnit unit) {
  return unit == LengthUnit::kMetres ? "metres" : "free";
}

LengthUnit length_unit_of(const std::string& text) {
  return word(text, "length_unit",
              Words<LengthUnit>{{"metres", LengthUnit::kMetres}, {"free", LengthUnit::kFree}});
}

namespace {

// Layouts that views rely on.
static_assert(sizeof(LandmarkId) == 8 && sizeof(FrameId) == 8 && sizeof(FrameIndex) == 4);
static_assert(sizeof(Pixel) == 16 && sizeof(Eigen::Vector3d) == 24 &&
              sizeof(Eigen::Matrix3d) == 72);

struct NoOptions {};

SharedMap read(const std::filesystem::path& path, const py::kwargs& keywords) {
  static const Keywords<NoOptions> table("read_map");
  CallOptions call;
  table.read(keywords, &call);
  SharedMap map;
  std::vector<std::string> remarks;
  run("reading", call, [&](Execution execution) {
    execution.log = [&](std::string_view remark) { remarks.emplace_back(remark); };
    map = std::make_shared<LandmarkMap>(all_formats().read(path, execution));
  });
  warn(remarks);
  return map;
}

void write(const SharedMap& map, const std::filesystem::path& path, const py::kwargs& keywords) {
  static const auto table = write_keywords();
  CallOptions call;
  const MapWriteOptions options = table.read(keywords, &call);
  std::vector<std::string> remarks;
  all_formats().format_to_write(path, options);  // throws before the work if there is none
  run("writing", call, [&](Execution execution) {
    execution.log = [&](std::string_view remark) { remarks.emplace_back(remark); };
    all_formats().write(*map, path, options, execution);
  });
  warn(remarks);
}

// A view of a column whose entries are one or several numbers: (n,) or (n, width).
template <class Number, class Entry>
py::object rows(const std::vector<Entry>& column, const SharedMap& map) {
  constexpr py::ssize_t kWidth = sizeof(Entry) / sizeof(Number);
  std::vector<py::ssize_t> shape = {static_cast<py::ssize_t>(column.size())};
  if (kWidth > 1) shape.push_back(kWidth);
  return view(reinterpret_cast<const Number*>(column.data()), std::move(shape), py::cast(map));
}

// A copy of a column of which `fill` writes the known entries, of this shape; NaN elsewhere. None if it is empty.
template <class Column, class Fill>
py::object rows_or_nan(const Column& column, std::vector<py::ssize_t> shape, const Fill& fill) {
  if (column.empty()) return py::none();
  const auto count = static_cast<py::ssize_t>(column.size());
  shape.insert(shape.begin(), count);
  py::array_t<double> array(std::move(shape));
  double* at = array.mutable_data();
  std::fill_n(at, array.size(), std::numeric_limits<double>::quiet_NaN());
  for (std::size_t i = 0; i < column.size(); ++i, at += array.size() / count) {
    if (const auto entry = column[i]) fill(*entry, at);
  }
  return array;
}

py::object covariances(const SharedMap& map) {
  if (!map->has_covariances()) return py::none();
  const auto& column = map->landmarks().covariances;
  // Eigen stores column by column.
  return view(reinterpret_cast<const double*>(column.data()),
              {static_cast<py::ssize_t>(column.size()), 3, 3}, py::cast(map), {72, 8, 24});
}

// (n, bytes each).
py::object descriptor_rows(const SharedMap& map, const std::vector<std::uint8_t>& bytes,
                           std::size_t bytes_each) {
  const auto width = static_cast<py::ssize_t>(bytes_each);
  const auto count = bytes_each == 0 ? 0 : static_cast<py::ssize_t>(bytes.size()) / width;
  return view(bytes.data(), {count, width}, py::cast(map));
}

py::dict named_columns(const SharedMap& map) {
  py::dict result;
  for (const NamedColumn& column : map->landmarks().columns) {
    result[py::str(column.name)] = column.values.visit(
        [&]<class T>(const std::vector<T>& values) { return rows<T>(values, map); });
  }
  return result;
}

py::array frame_poses(const SharedMap& map) {
  std::vector<Rigid3> poses;
  for (std::uint32_t i = 0; i < map->frame_count(); ++i)
    poses.push_back(map->world_from_camera({i}));
  return pose_arrays(poses);
}

py::object observation_counts(const SharedMap& map) {
  std::vector<std::int64_t> counts;
  for (std::uint32_t i = 0; i < map->landmark_count(); ++i) {
    counts.push_back(static_cast<std::int64_t>(map->observation_count(LandmarkIndex{i})));
  }
  return copied(counts);
}

py::object observed_landmarks(const SharedMap& map) {
  std::vector<std::uint32_t> landmarks;
  landmarks.reserve(map->observation_count());
  for (std::uint32_t i = 0; i < map->landmark_count(); ++i) {
    landmarks.insert(landmarks.end(), map->observation_count(LandmarkIndex{i}), i);
  }
  return copied(landmarks);
}

std::string described(const SharedMap& map) {
  std::string text =
      fmt::format("{} landmarks, {} frames", map->landmark_count(), map->frame_count());
  if (map->has_observations()) text += fmt::format(", {} observations", map->observation_count());
  if (map->has_covariances()) text += ", covariances";
  const auto& descriptors = map->landmarks().descriptors;
  if (descriptors) text += fmt::format(", {} descriptors", descriptors->kind);
  return text + (map->info().length_unit == LengthUnit::kMetres ? ", metres" : ", free scale");
}

py::bytes packed_map(const SharedMap& map) {
  std::string bytes;
  unlocked([&] { write_binary(*map, [&](std::string_view piece) { bytes += piece; }); });
  return bytes;
}

SharedMap unpacked_map(const py::bytes& bytes) {
  const std::string_view text = bytes;
  return unlocked([&] {
    MemoryReader reader(text, "pickled LandmarkMap");
    return std::make_shared<LandmarkMap>(read_binary(reader));
  });
}

std::vector<LandmarkIndex> landmark_indices(const LandmarkMap& map, py::handle given) {
  std::vector<LandmarkIndex> result;
  const py::array flags = py::array::ensure(given);
  if (!flags) PyErr_Clear();
  if (flags && flags.dtype().kind() == 'b') {
    const auto chosen =
        flag_array(given, "landmarks", {static_cast<py::ssize_t>(map.landmark_count())});
    for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
      if (chosen.data()[i]) result.push_back({i});
    }
    return result;
  }
  const auto array = integer_array(given, "landmarks", {-1});
  for (py::ssize_t i = 0; i < array.size(); ++i) {
    if (array.data()[i] < 0 || array.data()[i] >= static_cast<std::int64_t>(map.landmark_count())) {
      throw Error(ErrorKind::kMisuse, fmt::format("landmarks[{}]", i),
                  fmt::format("{}", array.data()[i]),
                  fmt::format("an index below {}", map.landmark_count()));
    }
    result.push_back({static_cast<std::uint32_t>(array.data()[i])});
  }
  return result;
}

void bind_georeference(py::module_& module) {
  Exposed<GeoReference>(
      module, "GeoReference",
      "Position of a map on the Earth (WGS 84), as a similarity from its frame to a topocentric\n"
      "frame.")
      .get("latitude_deg", "Of the origin of the topocentric frame.", &GeoReference::origin,
           &GeodeticPosition::latitude_deg)
      .get("longitude_deg", "", &GeoReference::origin, &GeodeticPosition::longitude_deg)
      .get("altitude_m", "", &GeoReference::origin, &GeodeticPosition::altitude_m)
      .get("enu_from_map", "(4, 4); metres to the east, to the north and up.",
           &GeoReference::enu_from_map)
      .def(
          "geodetic",
          [](const GeoReference& self, const py::object& positions) {
            const auto points = positions_of(positions, "positions");
            return row_array(points, [&](const Eigen::Vector3d& point) {
              const GeodeticPosition place = self.geodetic(point);
              return std::array{place.latitude_deg, place.longitude_deg, place.altitude_m};
            });
          },
          py::arg("positions"),
          "geodetic($self, positions)\n--\n\nLatitude and longitude in degrees and altitude in "
          "metres, (n, 3), of\n(n, 3) positions in the map.")
      .def("__eq__",
           [](const GeoReference& a, py::handle b) {
             return py::isinstance<GeoReference>(b) && a == b.cast<const GeoReference&>();
           })
      .def("__repr__", [](const GeoReference& self) {
        return fmt::format("GeoReference(latitude_deg={}, longitude_deg={}, altitude_m={})",
                           self.origin.latitude_deg, self.origin.longitude_deg,
                           self.origin.altitude_m);
      });
}

void bind_camera(py::module_& module) {
  Exposed<Camera> camera(module, "Camera",
                         "Intrinsics of a camera. Models are named as COLMAP does.");
  camera
      .def(py::init([](const std::string& model, std::uint32_t width, std::uint32_t height,
                       std::vector<double> parameters, std::uint64_t id) {
             Camera made{CameraId{id}, model, width, height, std::move(parameters)};
             const std::string defect = camera_defect(made);
             if (!defect.empty()) throw Error(ErrorKind::kMisuse, "Camera", defect, "");
             return made;
           }),
           py::arg("model"), py::arg("width"), py::arg("height"), py::arg("parameters"),
           py::kw_only(), py::arg("id") = 0,
           "__init__($self, model, width, height, parameters, *, id=0)\n--\n\n"
           "Camera('PINHOLE', 640, 480, [fx, fy, cx, cy])")
      .def_static(
          "read",
          [](const std::filesystem::path& path) {
            FileReader file(path);
            return read_camera_file(file).camera;
          },
          py::arg("path"), "read(path)\n--\n\nReads a camera file (docs/formats.md).")
      .def_static(
          "tum", &tum_camera, py::arg("name"),
          "tum(name)\n--\n\nA colour camera of the TUM RGB-D benchmark: 'fr1', 'fr2' or 'fr3'.")
      .get("id", "", &Camera::id)
      .def_readonly("model", &Camera::model)
      .def_readonly("width", &Camera::width, "pixels")
      .def_readonly("height", &Camera::height, "pixels")
      .def_readonly("parameters", &Camera::parameters)
      .def("__eq__",
           [](const Camera& a, py::handle b) {
             return py::isinstance<Camera>(b) && a == b.cast<const Camera&>();
           })
      .def("__repr__", [](const Camera& self) {
        return fmt::format("Camera({}, {}, {}, {})",
                           py::repr(py::str(self.model)).cast<std::string>(), self.width,
                           self.height, py::repr(py::cast(self.parameters)).cast<std::string>());
      });
  make_picklable(
      module, camera, "restored_camera",
      [](const py::object& object) {
        const auto& self = object.cast<const Camera&>();
        return py::make_tuple(self.id.value, self.model, self.width, self.height, self.parameters);
      },
      [](const py::tuple& state) {
        return Camera{CameraId{state[0].cast<std::uint64_t>()}, state[1].cast<std::string>(),
                      state[2].cast<std::uint32_t>(), state[3].cast<std::uint32_t>(),
                      state[4].cast<std::vector<double>>()};
      });
  camera.attr("__hash__") = py::none();
}

Keywords<SyntheticOptions> synthetic_keywords(const char* function) {
  return Keywords<SyntheticOptions>(function).add_table(SyntheticOptions::table,
                                                        [](auto& o) -> auto& { return o; });
}

struct SharedPair {
  SharedMap source;
  SharedMap target;
  Rigid3 target_from_source;
  std::vector<std::pair<LandmarkIndex, LandmarkIndex>> shared;
};

void bind_synthetic(py::module_& module) {
  Exposed<SharedPair>(module, "SyntheticPair",
                      "Two sessions of one synthetic scene, with the truth.")
      .def_readonly("source", &SharedPair::source)
      .def_readonly("target", &SharedPair::target)
      .get("target_from_source", "", &SharedPair::target_from_source)
      .get("shared", "(m, 2): indices, in source and target, of landmarks that are the same.",
           &SharedPair::shared,
           [](const auto& pairs) {
             return row_array(pairs, [](const auto& pair) {
               return std::array{pair.first.value, pair.second.value};
             });
           })
      .def("__repr__", [](const SharedPair& self) {
        return fmt::format("SyntheticPair(source: {}; target: {})", described(self.source),
                           described(self.target));
      });
  static const auto map_keywords = synthetic_keywords("synthetic_map");
  static const auto pair_keywords = synthetic_keywords("synthetic_pair");
  module.def(
      "synthetic_map",
      [](const py::kwargs& keywords) {
        CallOptions call;
        const SyntheticOptions options = map_keywords.read(keywords, &call);
        SharedMap map;
        run("synthetic map", call,
            [&](const Execution&) { map = std::make_shared<LandmarkMap>(synthetic_map(options)); });
        return map;
      },
      kept(map_keywords.signature("") + "A synthetic session: landmarks on a desk with boxes. The "
                                        "same seed gives the same map."));
  module.def(
      "synthetic_pair",
      [](const py::kwargs& keywords) {
        CallOptions call;
        const SyntheticOptions options = pair_keywords.read(keywords, &call);
        SharedPair shared;
        run("synthetic pair", call, [&](const Execution&) {
          SyntheticPair pair = synthetic_pair(options);
          shared = {std::make_shared<LandmarkMap>(std::move(pair.source)),
                    std::make_shared<LandmarkMap>(std::move(pair.target)), pair.target_from_source,
                    std::move(pair.shared)};
        });
        return shared;
      },
      kept(pair_keywords.signature("") +
           "Two synthetic sessions of one scene, each in its own world frame, with the truth."));
}

py::list rigs(const SharedMap& map) {
  py::list result;
  for (const Rig& rig : map->rigs()) {
    py::dict poses;
    for (const Rig::Mount& mount : rig.mounts) {
      poses[py::int_(mount.camera.value)] = copied_matrix(mount.camera_from_rig().matrix());
    }
    result.append(std::move(poses));
  }
  return result;
}

struct MapProperty {
  const char* name;
  py::object (*value)(const SharedMap& map);
  const char* what;
};

constexpr MapProperty kProperties[] = {
    {"positions", [](const SharedMap& m) { return rows<double>(m->landmarks().positions, m); },
     "(n, 3), in the world frame; a view."},
    {"covariances", [](const SharedMap& m) { return covariances(m); },
     "(n, 3, 3), NaN where unknown; a view, or None if absent."},
    {"ids", [](const SharedMap& m) { return rows<std::uint64_t>(m->landmarks().ids, m); },
     "(n,) uint64; a view."},
    {"colors",
     [](const SharedMap& m) { return masked<std::uint8_t>(m->landmarks().colors, py::cast(m)); },
     "(n, 3) uint8, masked where unknown; or None."},
    {"columns", [](const SharedMap& m) -> py::object { return named_columns(m); },
     "Named columns, (n,) each; views."},
    {"cameras",
     [](const SharedMap& m) -> py::object {
       return py::cast(std::vector<Camera>(m->cameras().begin(), m->cameras().end()));
     },
     ""},
    {"frame_ids", [](const SharedMap& m) { return rows<std::uint64_t>(m->frames().ids, m); },
     "(f,) uint64; a view."},
    {"frame_poses", [](const SharedMap& m) -> py::object { return frame_poses(m); },
     "(f, 4, 4), world_from_camera; a copy."},
    {"frame_positions",
     [](const SharedMap& m) { return rows<double>(m->frames().translations, m); },
     "(f, 3), camera centres; a view."},
    {"frame_quaternions",
     [](const SharedMap& m) { return rows<double>(m->frames().quaternions, m); },
     "(f, 4), world_from_camera as stored, w x y z; a view."},
    {"timestamps_s",
     [](const SharedMap& m) { return with_nan(m->frames().timestamps_s, py::cast(m)); },
     "(f,), NaN where unknown; or None."},
    {"frame_cameras",
     [](const SharedMap& m) { return masked<std::uint32_t>(m->frames().cameras, py::cast(m)); },
     "(f,) indices of cameras, masked where unknown; or None."},
    {"instants",
     [](const SharedMap& m) { return masked<std::uint32_t>(m->frames().instants, py::cast(m)); },
     "(f,), equal of frames that one rig took at one time, masked where unknown; or None."},
    {"rigs", [](const SharedMap& m) -> py::object { return rigs(m); },
     "One dict per rig: of indices of cameras, and (4, 4) camera_from_rig of each."},
    {"image_names",
     [](const SharedMap& m) -> py::object {
       if (m->frames().image_names.empty()) return py::none();
       return decoded(m->frames().image_names);
     },
     "One per frame, '' where unknown; or None."},
    {"gnss_positions",
     [](const SharedMap& m) {
       return rows_or_nan(m->frames().gnss, {4}, [](const auto& fix, double* row) {
         row[0] = fix.position.latitude_deg;
         row[1] = fix.position.longitude_deg;
         row[2] = fix.position.altitude_m;
         if (fix.accuracy_m) row[3] = *fix.accuracy_m;
       });
     },
     "(f, 4) latitude and longitude in degrees, altitude and accuracy in metres, NaN where "
     "unknown; or None."},
    {"pose_covariances",
     [](const SharedMap& m) {
       return rows_or_nan(m->frames().pose_covariances, {6, 6}, [](const Matrix6d& c, double* row) {
         Eigen::Map<Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>{row} = c;
       });
     },
     "(f, 6, 6) covariances of the keyframes' poses, translation then rotation about the "
     "map's axes, relative to the first keyframe; NaN where unknown; or None."},
    {"keypoints",
     [](const SharedMap& m) {
       return masked<std::uint32_t>(m->observations().keypoints, py::cast(m));
     },
     "(o,), masked where unknown; or None."},
    {"depths", [](const SharedMap& m) { return with_nan(m->observations().depths, py::cast(m)); },
     "(o,), measured along the optical axis, NaN where unknown; or None."},
    {"octaves",
     [](const SharedMap& m) {
       return masked<std::int32_t>(m->observations().octaves, py::cast(m));
     },
     "(o,), masked where unknown; or None."},
    {"sigmas_px",
     [](const SharedMap& m) { return with_nan(m->observations().sigmas_px, py::cast(m)); },
     "(o,), standard deviations of the pixels, NaN where unknown; or None."},
    {"length_unit", [](const SharedMap& m) { return seen(m->info().length_unit); },
     "'metres' or 'free'."},
    {"world_frame", [](const SharedMap& m) { return seen(m->info().world_frame); }, ""},
    {"gravity", [](const SharedMap& m) { return seen(m->info().gravity); },
     "(3,), downward direction in the world frame; or None."},
    {"georeference", [](const SharedMap& m) { return seen(m->info().georeference); },
     "GeoReference of the map; or None."},
    {"uuid", [](const SharedMap& m) { return seen(m->info().uuid); }, ""},
    {"provenance", [](const SharedMap& m) { return seen(m->info().provenance); },
     "History of the map, oldest entry first."},
};

// None without observations.
constexpr MapProperty kPropertiesOfObservations[] = {
    {"observation_offsets",
     [](const SharedMap& m) { return rows<std::uint64_t>(m->observations().offsets, m); },
     "(n + 1,): landmark i's observations are [offsets[i], offsets[i + 1]); a view, or None."},
    {"observation_counts", [](const SharedMap& m) -> py::object { return observation_counts(m); },
     "(n,); or None."},
    {"observed_landmarks", [](const SharedMap& m) -> py::object { return observed_landmarks(m); },
     "(o,), landmark index of each observation; or None."},
    {"observing_frames",
     [](const SharedMap& m) { return rows<std::uint32_t>(m->observations().frames, m); },
     "(o,), frame index of each observation; a view, or None."},
    {"pixels", [](const SharedMap& m) { return rows<double>(m->observations().pixels, m); },
     "(o, 2); a view, or None."},
};

// None without descriptors.
constexpr MapProperty kPropertiesOfDescriptors[] = {
    {"descriptors",
     [](const SharedMap& m) -> py::object {
       return descriptor_rows(m, m->landmarks().descriptors->bytes,
                              m->landmarks().descriptors->bytes_each);
     },
     "(n, bytes) uint8, zero where unknown; a view, or None."},
    {"known_descriptors",
     [](const SharedMap& m) -> py::object {
       return rows<std::uint8_t>(m->landmarks().descriptors->known, m).attr("view")("bool");
     },
     "(n,) bool; a view, or None."},
    {"descriptor_kind", [](const SharedMap& m) { return seen(m->landmarks().descriptors->kind); },
     "E.g. 'ORB'; None if absent."},
};

// None without further descriptors.
constexpr MapProperty kPropertiesOfFurtherDescriptors[] = {
    {"further_descriptors",
     [](const SharedMap& m) -> py::object {
       return descriptor_rows(m, m->landmarks().descriptors->further,
                              m->landmarks().descriptors->bytes_each);
     },
     "(m, bytes) uint8, of further views of the landmarks, those of one landmark after another; a "
     "view, or None."},
    {"further_descriptor_offsets",
     [](const SharedMap& m) {
       return rows<std::uint64_t>(m->landmarks().descriptors->further_offsets, m);
     },
     "(n + 1,) uint64: landmark i has the rows from offset i to below offset i + 1 of "
     "further_descriptors; a view, or None."},
};

bool has_descriptors(const LandmarkMap& map) {
  return map.landmarks().descriptors.has_value();
}

bool has_further_descriptors(const LandmarkMap& map) {
  return has_descriptors(map) && map.landmarks().descriptors->has_further();
}

// @param has whether a map has the properties, which are None otherwise; null: it has
void add_properties(MapClass& map, std::span<const MapProperty> properties,
                    bool (*has)(const LandmarkMap&)) {
  for (const MapProperty& property : properties) {
    map.def_property_readonly(
        property.name,
        [has, value = property.value](const SharedMap& self) -> py::object {
          if (has != nullptr && !has(*self)) return py::none();
          return value(self);
        },
        property.what);
  }
}

// The map that `make` returns, made without the GIL.
template <class Make>
SharedMap derived(const Make& make) {
  return unlocked([&] { return std::make_shared<LandmarkMap>(make()); });
}

void bind_operations(MapClass& map) {
  map.def(
         "transformed",
         [](const SharedMap& self, const py::object& new_from_old) {
           const Similarity3 pose = similarity_of(new_from_old, "new_from_old");
           return derived([&] { return transformed(*self, pose); });
         },
         py::arg("new_from_old"),
         "transformed($self, new_from_old)\n--\n\nThe map in another world frame, by a 4x4 "
         "matrix.")
      .def(
          "in_enu_frame",
          [](const SharedMap& self) { return derived([&] { return in_enu_frame(*self); }); },
          "in_enu_frame($self)\n--\n\nThe map in the frame of its georeference: metres to the "
          "east, to the\nnorth and up.")
      .def(
          "select",
          [](const SharedMap& self, const py::object& landmarks) {
            const auto indices = landmark_indices(*self, landmarks);
            return derived([&] { return with_landmarks(*self, indices); });
          },
          py::arg("landmarks"),
          "select($self, landmarks)\n--\n\nThe map with only these landmarks (indices or a mask) "
          "and all frames.")
      .def(
          "with_column",
          [](const SharedMap& self, const std::string& name, const py::object& values) {
            const auto array =
                real_array(values, "values", {static_cast<py::ssize_t>(self->landmark_count())},
                           Masked::kUnknown);
            return derived([&] {
              return with_column(*self, name,
                                 std::vector<double>(array.data(), array.data() + array.size()));
            });
          },
          py::arg("name"), py::arg("values"),
          "with_column($self, name, values)\n--\n\nThe map with a named column added or replaced.")
      .def(
          "with_camera",
          [](const SharedMap& self, const Camera& camera) {
            return derived([&] { return with_camera(*self, camera); });
          },
          py::arg("camera"),
          "with_camera($self, camera)\n--\n\nThe map with one camera, for all frames.")
      .def(
          "with_length_unit",
          [](const SharedMap& self, const std::string& length_unit) {
            const LengthUnit unit = length_unit_of(length_unit);
            return derived([&] { return with_length_unit(*self, unit); });
          },
          py::arg("length_unit"),
          "with_length_unit($self, length_unit)\n--\n\nThe map with the same numbers and length "
          "unit 'metres' or 'free'.")
      .def(
          "cut_frames",
          [](const SharedMap& self, std::uint64_t begin, std::uint64_t end) {
            return derived([&] { return cut_frames(*self, FrameId{begin}, FrameId{end}); });
          },
          py::arg("begin"), py::arg("end"),
          "cut_frames($self, begin, end)\n--\n\n"
          "The frames with ids in [begin, end), and the landmarks that only these observed.");
}

}  // namespace

Keywords<MapWriteOptions> write_keywords() {
  Keywords<MapWriteOptions> keywords("write");
  keywords.add("format", [](auto& o) -> auto& { return o.format; })
      .add("native_version", [](auto& o) -> auto& { return o.native_version; })
      .add("ascii", [](auto& o) -> auto& { return o.ascii; })
      .add("double_precision", [](auto& o) -> auto& { return o.double_precision; });
  return keywords;
}

void bind_maps(py::module_& module) {
  bind_georeference(module);
  bind_camera(module);
  MapClass map(
      module, "LandmarkMap",
      "A landmark map: keyframes, landmarks and observations. Immutable.\n\n"
      "Columns are NumPy arrays: read-only views of the map's memory, which they keep alive, or "
      "copies\n"
      "if entries may be unknown. An absent column is None.");
  bind_from_arrays(map);
  map.def("write", &write, py::arg("path"), kept([] {
            std::string text = write_keywords().signature("$self, path");
            return text +
                   "Writes the map, completely or not at all, in the format of the path's ending "
                   "or "
                   "in `format`.\n"
                   "Warns of data that the format cannot hold.";
          }()))
      .def("__len__", &LandmarkMap::landmark_count)
      .def("__repr__",
           [](const SharedMap& self) { return "<LandmarkMap: " + described(self) + ">"; })
      .def("__copy__", [](const SharedMap& self) { return self; })
      .def(
          "__deepcopy__", [](const SharedMap& self, const py::dict&) { return self; },
          py::arg("memo"));
  add_properties(map, kProperties, nullptr);
  add_properties(map, kPropertiesOfObservations,
                 [](const LandmarkMap& one) { return one.has_observations(); });
  add_properties(map, kPropertiesOfDescriptors, &has_descriptors);
  add_properties(map, kPropertiesOfFurtherDescriptors, &has_further_descriptors);
  bind_operations(map);
  make_picklable(
      module, map, "restored_map",
      [](const py::object& self) { return packed_map(self.cast<SharedMap>()); }, &unpacked_map);

  module.def(
      "read_map", &read, py::arg("path"),
      "read_map(path, *, threads=0, progress=None)\n--\n\n"
      "Reads a map in any supported format, recognised by content, from a file, a folder, or\n"
      "'path#N' for one of several maps in a file. Warns of data that is left out.\n\n"
      "Raises InputError with .file, .line and .expected if the map cannot be read.");
  module.def(
      "formats",
      [] {
        py::dict result;
        for (const MapFormat& format : all_formats().formats()) {
          result[py::str(format.name)] = format.title;
        }
        return result;
      },
      "formats()\n--\n\nDict of the map formats' titles by name.");
  bind_synthetic(module);
}

}  // namespace cairn::python
