// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <cstring>
#include <optional>
#include <string>
#include <unordered_map>
#include <utility>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/formats/detail/foreign/colmap_priors.hpp"
#include "cairn/formats/detail/foreign/database_file.hpp"
#include "cairn/formats/detail/foreign/foreign_formats.hpp"
#include "cairn/formats/detail/foreign/sfm_builder.hpp"
#include "cairn/formats/detail/losses.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/storage/sqlite/database.hpp"

namespace cairn::detail {
namespace {

namespace fs = std::filesystem;

constexpr std::int64_t kSift = 0;  // of COLMAP's types of features, -1 if undefined
constexpr std::size_t kSiftBytes = 128;

// Descriptors of one type. COLMAP stores bytes: those of SIFT, or of 32-bit floats.
struct Features {
  std::int64_t type = kSift;
  std::size_t columns = 0;  // bytes of one in the database

  bool is_sift() const { return type == kSift; }
  std::size_t bytes_each() const { return is_sift() ? columns : columns / sizeof(float); }
  std::string kind() const {
    static constexpr std::array<std::string_view, 3> kKinds = {"SIFT", "ALIKED_N16ROT",
                                                               "ALIKED_N32"};
    const auto index = static_cast<std::size_t>(type);
    return index < kKinds.size() ? std::string(kKinds[index]) : fmt::format("COLMAP_{}", type);
  }
  friend bool operator==(const Features&, const Features&) = default;
};

// nullopt if they are neither SIFT nor floats. Databases of before COLMAP 4 have no type.
std::optional<Features> features_of(std::int64_t type, std::uint64_t columns) {
  constexpr std::uint64_t kFewestFloats = 16;
  if (type <= kSift || (type == 1 && columns == kSiftBytes)) {
    if (columns != kSiftBytes) return std::nullopt;
    return Features{kSift, kSiftBytes};
  }
  const bool are_floats = columns % sizeof(float) == 0 &&
                          columns >= kFewestFloats * sizeof(float) &&
                          columns / sizeof(float) <= kMostDescriptorBytes;
  if (!are_floats) return std::nullopt;
  return Features{type, static_cast<std::size_t>(columns)};
}

// A matrix as stored in a database.
struct Matrix {
  std::uint64_t rows = 0;
  std::uint64_t columns = 0;
  std::span<const std::byte> bytes;
};

Matrix matrix(const sqlite::Database& database, const sqlite::Statement& row, const char* table,
              std::size_t bytes_each) {
  Matrix result{row.unsigned_integer(0), row.unsigned_integer(1),
                row.optional_blob(2).value_or(std::span<const std::byte>{})};
  const bool is_whole = result.columns <= 65536 && result.rows <= (std::uint64_t{1} << 40) &&
                        result.rows * result.columns * bytes_each == result.bytes.size();
  if (!is_whole) {
    refuse_database(database, table,
                    fmt::format("{} x {} numbers in {} bytes", result.rows, result.columns,
                                result.bytes.size()),
                    fmt::format("{} bytes a number", bytes_each));
  }
  return result;
}

class DescriptorReader {
 public:
  DescriptorReader(const LandmarkMap& model, sqlite::Database& database, const Execution& execution)
      : landmarks_(model), database_(database), execution_(execution) {
    for (std::uint32_t i = 0; i < model.frame_count() && !model.frames().image_names.empty(); ++i) {
      frame_of_.emplace(model.frames().image_names[i], FrameIndex{i});
    }
  }

  std::optional<DescriptorColumn> read() {
    auto image = database_.prepare("SELECT image_id, name FROM images ORDER BY image_id");
    auto keypoints =
        database_.prepare("SELECT rows, cols, data FROM keypoints WHERE image_id = ?1");
    // Without a type they are SIFT.
    auto descriptors = database_.prepare(
        fmt::format("SELECT rows, cols, data, {} FROM descriptors WHERE image_id = ?1",
                    column_or_null(database_, "descriptors", "type")));
    while (image.step()) {
      const auto frame = frame_of_.find(std::string(image.text(1)));
      if (frame == frame_of_.end()) continue;
      ++found_;
      const std::int64_t id = image.integer(0);
      keypoints.bind_all(id);
      descriptors.bind_all(id);
      const bool has_both = keypoints.step() && descriptors.step();
      if (has_both) take(frame->second, keypoints, descriptors);
      keypoints.reset();
      descriptors.reset();
    }
    remark();
    if (!features_) return std::nullopt;
    return landmarks_.column(features_->kind(), features_->bytes_each());
  }

 private:
  void take(FrameIndex frame, const sqlite::Statement& keypoint_row,
            const sqlite::Statement& descriptor_row) {
    const Matrix keypoints = matrix(database_, keypoint_row, "keypoints", sizeof(float));
    const auto features = features_of(descriptor_row.optional_integer(3).value_or(kSift),
                                      descriptor_row.unsigned_integer(1));
    if (!features_ && features) features_ = features;
    if (!features || features != features_) {
      ++of_other_kind_;
      return;
    }
    const Matrix descriptors = matrix(database_, descriptor_row, "descriptors", 1);
    const auto wanted = landmarks_.wanted(frame);
    const bool covers = keypoints.columns >= 2 && keypoints.rows == descriptors.rows &&
                        std::ranges::all_of(wanted, [&](const auto& one) {
                          return one.keypoint < descriptors.rows;
                        });
    if (!covers || !landmarks_.are_near(frame, [&](std::uint32_t keypoint) {
          return pixel_of(keypoints, keypoint);
        })) {
      ++other_features_;
      return;
    }
    for (const auto& one : wanted) {
      set(one, descriptors.bytes.subspan(one.keypoint * features->columns, features->columns));
    }
  }

  void set(const ModelDescriptors::Wanted& wanted, std::span<const std::byte> stored) {
    if (features_->is_sift()) {
      std::array<std::uint8_t, kSiftBytes> bytes{};
      std::memcpy(bytes.data(), stored.data(), bytes.size());
      landmarks_.set(wanted, bytes);
    } else {
      std::vector<float> values(features_->bytes_each());
      std::memcpy(values.data(), stored.data(), stored.size());
      landmarks_.set(wanted, std::span<const float>(values));
    }
  }

  static Pixel pixel_of(const Matrix& keypoints, std::uint32_t keypoint) {
    std::array<float, 2> xy{};
    std::memcpy(xy.data(), keypoints.bytes.data() + keypoint * keypoints.columns * sizeof(float),
                sizeof xy);
    return {double{xy[0]} - kPixelCentre, double{xy[1]} - kPixelCentre};
  }

  void remark() const {
    if (!execution_.log) return;
    const auto say = [&](std::size_t count, std::string_view what,
                         RemarkKind kind = RemarkKind::kLoss) {
      if (count > 0)
        execution_.log({fmt::format("{}: {} {}", database_.name(), count, what), kind});
    };
    say(landmarks_.model().frame_count() - std::min(found_, landmarks_.model().frame_count()),
        "images of the model are not in the database: no descriptors", RemarkKind::kInformation);
    say(of_other_kind_, fmt::format("images have descriptors other than {}; left out",
                                    features_ ? features_->kind() : "SIFT or of floats"));
    say(other_features_, "images have other keypoints than the model; left out");
  }

  ModelDescriptors landmarks_;
  sqlite::Database& database_;
  const Execution& execution_;
  std::unordered_map<std::string, FrameIndex> frame_of_;
  std::optional<Features> features_;  // of the first image that has any
  std::size_t found_ = 0;
  std::size_t of_other_kind_ = 0;
  std::size_t other_features_ = 0;
};

// The folder of a model, in the binary form if there are both.
std::optional<ColmapForm> form_of(const fs::path& folder) {
  if (is_file(folder / "points3D.bin")) return ColmapForm::kBinary;
  if (is_file(folder / "points3D.txt")) return ColmapForm::kText;
  return std::nullopt;
}

constexpr std::array<std::string_view, 3> kTables = {"images", "keypoints", "descriptors"};

bool is_colmap_database(const fs::path& path) {
  return is_database_with(path, {kTables[0], kTables[1], kTables[2]});
}

LandmarkMap read_with_model(const MapInput& input, const Execution& execution) {
  const fs::path folder = input.path.parent_path();
  const std::string part = input.part.value_or("0");
  // Also as instant-ngp (colmap_*) and kapture (reconstruction) lay out their projects.
  std::vector<fs::path> places = {folder / "sparse" / part, folder / part,
                                  folder / "colmap_sparse" / part,
                                  folder / "reconstruction" / part};
  if (!input.part) {
    for (const char* name : {"sparse", "", "colmap_sparse", "colmap_text", "reconstruction"}) {
      places.push_back(*name == '\0' ? folder : folder / name);
    }
  }
  for (const fs::path& place : places) {
    if (const auto form = form_of(place)) {
      log_remark(execution.log, input.path.string(),
                 "read with the model in " + (place.empty() ? "." : place.string()));
      return with_colmap_descriptors(read_colmap(place, *form, execution), input.path, execution);
    }
  }
  throw Error(ErrorKind::kInput, input.path.string(),
              "is COLMAP's database of features, and no model lies beside it",
              "a model in " + places.front().string());
}

// What a database adds to a model.
struct DatabaseContent {
  std::optional<DescriptorColumn> descriptors;
  ColmapPriors priors;
};

DatabaseContent read_database(const LandmarkMap& model, const fs::path& path,
                              const Execution& execution) {
  sqlite::Database database = open_foreign_database(path, execution);
  for (const std::string_view table : kTables) {
    reject_if(!database.has_table(table), path.string(), fmt::format("has no table {}", table),
              "a database of COLMAP");
  }
  return {DescriptorReader(model, database, execution).read(),
          read_colmap_priors(model, database, execution)};
}

// COLMAP's databases in a folder: database.db, or else all others by their tables.
std::vector<fs::path> databases_in(const fs::path& folder) {
  if (is_file(folder / "database.db")) return {folder / "database.db"};
  std::vector<fs::path> databases;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    const fs::path& path = entry->path();
    if (path.extension() == ".db" && is_file(path) && is_colmap_database(path)) {
      databases.push_back(path);
    }
  }
  std::sort(databases.begin(), databases.end());
  return databases;
}

LandmarkMap with_content(LandmarkMap model, DatabaseContent content) {
  MapTables tables = std::move(model).tables();
  tables.landmarks.descriptors = std::move(content.descriptors);
  tables.frames.gnss = std::move(content.priors.gnss);
  tables.info.gravity = content.priors.gravity;
  return LandmarkMap(std::move(tables));
}

}  // namespace

LandmarkMap with_colmap_descriptors(LandmarkMap model, const fs::path& database,
                                    const Execution& execution) {
  DatabaseContent content = read_database(model, database, execution);
  return with_content(std::move(model), std::move(content));
}

std::vector<MapFormat> database_formats() {
  return {{.name = "colmap-database",
           .title = "COLMAP database",
           .holds_several = true,
           .recognises =
               [](const MapInput& input) {
                 return is_database(input) && is_colmap_database(input.path);
               },
           .read = &read_with_model},
          {.name = "stella-database",
           .title = "stella_vslam database",
           .recognises =
               [](const MapInput& input) {
                 return is_database_with(input, {"keyframes", "landmarks", "associations"});
               },
           .read = &read_path<&read_stella_database>},
          {.name = "rtabmap",
           .title = "RTAB-Map",
           .recognises =
               [](const MapInput& input) {
                 return is_database_with(input, {"Node", "Link", "Data"});
               },
           .read = &read_path<&read_rtabmap>}};
}

LandmarkMap with_database_beside(LandmarkMap model, const fs::path& folder,
                                 const Execution& execution) {
  std::error_code ignored;
  fs::path place =
      fs::absolute(folder.empty() ? fs::path(".") : folder, ignored).lexically_normal();
  if (!place.has_filename()) place = place.parent_path();
  for (int up = 0; up < 3; ++up, place = place.parent_path()) {
    const std::vector<fs::path> databases = databases_in(place);
    if (databases.empty()) continue;
    if (databases.size() > 1) {
      log_remark(execution.log, place.string(),
                 fmt::format("holds several databases of COLMAP, {} and {}; descriptors are left "
                             "out: keep one of them there, or call it database.db",
                             databases[0].filename().string(), databases[1].filename().string()),
                 RemarkKind::kLoss);
      return model;
    }
    try {
      DatabaseContent content = read_database(model, databases.front(), execution);
      return with_content(std::move(model), std::move(content));
    } catch (const Error& error) {
      if (error.kind() != ErrorKind::kInput) throw;
      // The user did not name this file, and the model is complete without it.
      if (execution.log) {
        execution.log(
            {fmt::format("{}; what it holds is left out", error.what()), RemarkKind::kLoss});
      }
      return model;
    }
  }
  return model;
}

}  // namespace cairn::detail
