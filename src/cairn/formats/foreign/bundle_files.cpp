// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/core/statistics.hpp"
#include "cairn/core/text.hpp"
#include "cairn/formats/detail/bytes/record_reader.hpp"
#include "cairn/formats/detail/bytes/words.hpp"
#include "cairn/formats/detail/foreign/foreign_formats.hpp"
#include "cairn/formats/detail/foreign/sfm_builder.hpp"
#include "cairn/formats/detail/foreign/written_frames.hpp"
#include "cairn/formats/detail/losses.hpp"
#include "cairn/map/operations.hpp"

// Formats whose observations are relative to the centre of an image of unknown size (docs/formats.md). The
// camera gets the smallest size, symmetric about the centre, that contains its observations.
namespace cairn::detail {
namespace {

constexpr double kFarthest = 1e9;  // pixels; larger than any image
constexpr std::uint64_t kMostViews = std::numeric_limits<std::uint32_t>::max() - 1;

// One camera of such a file.
struct View {
  SfmFrame frame;
  double focal = 0.0;
  double k1 = 0.0;
  double k2 = 0.0;
  /// VisualSFM's distortion of the measurement: m becomes m (1 + k |m|² / focal²).
  double measured_k = 0.0;

  /// A measurement without VisualSFM's distortion.
  Pixel undistorted(Pixel measured) const {
    if (measured_k == 0.0 || focal == 0.0) return measured;
    const double r2 = (measured.u * measured.u + measured.v * measured.v) / (focal * focal);
    return {measured.u * (1.0 + measured_k * r2), measured.v * (1.0 + measured_k * r2)};
  }
  /// Where a point appears, in pixels right and down of the principal point; std::nullopt if it is behind the camera.
  std::optional<Eigen::Vector2d> offset_of(const Eigen::Vector3d& point, double k) const {
    const Eigen::Vector3d x = frame.world_from_camera.conjugate() * (point - frame.centre);
    if (!(x.z() > 0.0)) return std::nullopt;
    const Eigen::Vector2d p = x.head<2>() / x.z();
    return focal * (1.0 + k * p.squaredNorm()) * p;
  }
};

// The middle of values to which an image's size, a whole number, gives half pixels: the nearest of these, unless the
// values contradict it.
double middle_of(const std::vector<double>& values) {
  const double median = upper_median(std::vector<double>(values));
  std::vector<double> deviations;
  for (const double value : values) deviations.push_back(std::abs(value - median));
  const double error = 1.25 * 1.4826 * upper_median(std::move(deviations)) /
                       std::sqrt(static_cast<double>(values.size()));
  const double half = std::round(2.0 * median) / 2.0;
  return std::abs(half - median) <= std::max(3.0 * error, 1e-6) ? half : median;
}

// Reads words, across lines or within one line.
class Words {
 public:
  explicit Words(TextRecords& in, bool across_lines = true)
      : in_(in), across_lines_(across_lines) {}

  double number(std::string_view field) {
    ensure(field);
    return in_.number(field);
  }
  std::uint64_t count(std::string_view field) {
    ensure(field);
    return in_.unsigned_number(field, kMostViews);
  }
  Eigen::Vector3d vector3(std::string_view field) {
    Eigen::Vector3d result;
    for (int i = 0; i < 3; ++i) result[i] = number(field);
    return result;
  }

 private:
  void ensure(std::string_view field) {
    while (across_lines_ && !in_.has_word()) {
      if (!in_.next_record()) in_.refuse(field, "the file ends before it", "one number more");
    }
  }

  TextRecords& in_;
  bool across_lines_;
};

// Collects the cameras and points of a file, whose images have no stated size.
class BundleReader {
 public:
  BundleReader(ByteSource& source, const Execution& execution) : out_(source.name(), execution) {}

  const SfmBuilder& log() const { return out_; }

  /// A camera that was never registered has no frame.
  void add_unregistered() { views_.emplace_back(); }

  void add_view(const TextRecords& in, View view) {
    if (!view.frame.centre.allFinite()) in.refuse("pose", "the position is not finite", "numbers");
    view.frame.id = FrameId{views_.size()};
    SfmFrame frame = view.frame;
    frame.world_from_camera.normalize();
    const FrameIndex index = out_.add_frame(std::move(frame));
    view_of_frame_.push_back(views_.size());
    views_.push_back({std::move(view), index});
  }

  // A point with its colour and observations.
  // @param down 1 if y points down in the image, -1 if up
  void read_point(const TextRecords& in, Words& words, double down) {
    const Eigen::Vector3d position = words.vector3("position");
    Eigen::Vector3d rgb;
    constexpr std::array<const char*, 3> kChannels = {"red", "green", "blue"};
    for (int i = 0; i < 3; ++i) rgb[i] = words.number(kChannels[static_cast<std::size_t>(i)]);
    out_.add_landmark(out_.landmark_count(), position, color_of(rgb));
    const std::uint64_t observations = words.count("number of views");
    for (std::uint64_t i = 0; i < observations; ++i) {
      const std::uint64_t view = words.count("camera of an observation");
      const auto key = static_cast<std::uint32_t>(words.count("key of an observation"));
      const double x = words.number("x of an observation");
      const double y = words.number("y of an observation");
      add_observation(in, view, {x, down * y}, key);
    }
  }

  /// @param may_count_from_corner whether programs write measurements in this format from the image's corner
  LandmarkMap finish(bool may_count_from_corner = false) && {
    if (!may_count_from_corner || !count_from_corner()) count_from_principal_point();
    make_cameras();
    if (!out_.tables().cameras.empty()) note_unstated_image_sizes(out_.tables().info);
    return std::move(out_).finish();
  }

 private:
  struct KnownView {
    View view;
    std::optional<FrameIndex> frame = {};
  };
  // Of a frame: its principal point and size.
  struct Place {
    double cx = 0.0;
    double cy = 0.0;
    double width = 0.0;
    double height = 0.0;
  };

  // @param offset right and down of the centre of the image, in pixels
  void add_observation(const TextRecords& in, std::uint64_t view, const Pixel& offset,
                       std::uint32_t keypoint) {
    if (view >= views_.size()) {
      in.refuse("camera of an observation", fmt::format("{} of {}", view, views_.size()),
                "a camera of the file");
    }
    const KnownView& known = views_[view];
    if (!known.frame) {
      in.refuse("camera of an observation", fmt::format("camera {} has no pose", view),
                "a registered camera");
    }
    for (const Pixel& pixel : {offset, known.view.undistorted(offset)}) {
      if (std::abs(pixel.u) <= kFarthest && std::abs(pixel.v) <= kFarthest) continue;
      in.refuse("observation", fmt::format("({}, {}) is in no image", pixel.u, pixel.v), "pixels");
    }
    out_.add_observation({.landmark_id = out_.landmark_count() - 1,
                          .frame = *known.frame,
                          .pixel = offset,
                          .keypoint = keypoint});
  }

  View& view_of(FrameIndex frame) { return views_[view_of_frame_[frame.value]].view; }

  // Measurements are relative to the principal point: gives each image the smallest size that holds them.
  void count_from_principal_point() {
    ObservationTable& observations = out_.tables().observations;
    std::size_t undistorted = 0;
    places_.resize(out_.frame_count());
    for (std::size_t i = 0; i < observations.frames.size(); ++i) {
      Pixel& pixel = observations.pixels[i];
      const View& view = view_of(observations.frames[i]);
      undistorted += view.measured_k != 0.0 ? 1 : 0;
      pixel = view.undistorted(pixel);
      Place& place = places_[observations.frames[i].value];
      // Sizes 2n + 1 have their centre on the pixel (n, n).
      place.cx = std::max(place.cx, std::ceil(std::abs(pixel.u)));
      place.cy = std::max(place.cy, std::ceil(std::abs(pixel.v)));
    }
    for (std::size_t i = 0; i < observations.frames.size(); ++i) {
      const Place& place = places_[observations.frames[i].value];
      observations.pixels[i].u += place.cx;
      observations.pixels[i].v += place.cy;
    }
    for (Place& place : places_) {
      place.width = 2.0 * place.cx + 1.0;
      place.height = 2.0 * place.cy + 1.0;
    }
    if (!places_.empty()) {
      out_.remark(
          "states no image sizes: each camera has the smallest that holds its observations");
    }
    if (undistorted > 0) {
      out_.remark(fmt::format(
          "{} observations are undistorted: VisualSFM's distortion, of the measurement, "
          "is no camera model of Cairn's",
          undistorted));
    }
  }

  // COLMAP writes NVM with measurements from the image's corner, and a distortion of opposite sign. Few are negative then
  // (of undistorted images), and they show the principal point, which is half the size of the image.
  // @return false if they are relative to the principal point, as the format says
  bool count_from_corner() {
    ObservationTable& observations = out_.tables().observations;
    constexpr std::size_t kFewest = 8;
    std::vector<Pixel> most(out_.frame_count());  // of each frame
    std::size_t negative = 0;
    for (std::size_t i = 0; i < observations.frames.size(); ++i) {
      const Pixel& pixel = observations.pixels[i];
      Pixel& farthest = most[observations.frames[i].value];
      negative += pixel.u < 0.0 || pixel.v < 0.0 ? 1 : 0;
      farthest = {std::max(farthest.u, pixel.u), std::max(farthest.v, pixel.v)};
    }
    if (10 * negative > observations.frames.size()) return false;
    // NVM does not say which images have one camera: those of equal numbers, and both upright or not.
    using Key = std::tuple<double, double, bool>;
    const auto key_of = [&](FrameIndex frame) {
      const View& view = view_of(frame);
      return Key(view.focal, view.measured_k, most[frame.value].v > most[frame.value].u);
    };
    std::map<Key, std::array<std::vector<double>, 2>> principal_points;  // that observations show
    std::vector<double> from_principal_point;
    std::vector<double> from_corner;
    for (std::size_t i = 0; i < observations.frames.size(); ++i) {
      const FrameIndex frame = observations.frames[i];
      const View& view = view_of(frame);
      const Eigen::Vector3d& point = out_.tables().landmarks.positions[out_.observed_ids()[i]];
      const auto plain = view.offset_of(point, 0.0);
      const auto distorted = view.offset_of(point, -view.measured_k);
      if (!plain || !distorted) continue;
      const Pixel pixel = observations.pixels[i];
      const Pixel undistorted = view.undistorted(pixel);
      const double error = std::hypot(undistorted.u - plain->x(), undistorted.v - plain->y());
      const Pixel shown{pixel.u - distorted->x(), pixel.v - distorted->y()};
      if (!(error <= kFarthest) || !(std::hypot(shown.u, shown.v) <= kFarthest)) continue;
      from_principal_point.push_back(error);
      from_corner.push_back(
          std::hypot(shown.u - 0.5 * most[frame.value].u, shown.v - 0.5 * most[frame.value].v));
      auto& [us, vs] = principal_points[key_of(frame)];
      us.push_back(shown.u);
      vs.push_back(shown.v);
    }
    // The middle of what was observed is a rough principal point, but the corner is none at all.
    if (from_corner.size() < kFewest || 3.0 * upper_median(std::move(from_corner)) >=
                                            upper_median(std::move(from_principal_point))) {
      return false;
    }
    for (std::uint32_t i = 0; i < most.size(); ++i) {
      const auto& [us, vs] = principal_points[key_of(FrameIndex{i})];
      const Pixel centre = us.size() >= kFewest ? Pixel{middle_of(us), middle_of(vs)}
                                                : Pixel{0.5 * most[i].u, 0.5 * most[i].v};
      // The centre of the first pixel is (0.5, 0.5) for COLMAP.
      places_.push_back({centre.u - kPixelCentre, centre.v - kPixelCentre,
                         std::max(std::round(2.0 * centre.u), std::floor(most[i].u) + 1.0),
                         std::max(std::round(2.0 * centre.v), std::floor(most[i].v) + 1.0)});
    }
    for (Pixel& pixel : observations.pixels) {
      pixel = {pixel.u - kPixelCentre, pixel.v - kPixelCentre};
    }
    for (KnownView& known : views_) known.view.k1 = 0.0 - std::exchange(known.view.measured_k, 0.0);
    out_.remark(
        "measurements are from the corner of the images, as COLMAP writes them; the file states no "
        "image sizes: principal points and sizes are those that the points show");
    return true;
  }

  void make_cameras() {
    MapTables& tables = out_.tables();
    std::size_t unknown = 0;
    for (std::uint32_t i = 0; i < out_.frame_count(); ++i) {
      const View& view = view_of(FrameIndex{i});
      const Place& place = places_[i];
      const Camera camera{CameraId{tables.frames.ids[i].value},
                          "RADIAL",
                          static_cast<std::uint32_t>(place.width),
                          static_cast<std::uint32_t>(place.height),
                          {view.focal, place.cx, place.cy, view.k1, view.k2}};
      if (!camera_defect(camera).empty()) {
        ++unknown;
        continue;
      }
      tables.frames.cameras.set(i, CameraIndex{static_cast<std::uint32_t>(tables.cameras.size())});
      tables.cameras.push_back(camera);
    }
    out_.lost(unknown, "cameras are unknown to the map: their model is none of Cairn's");
  }

  SfmBuilder out_;
  std::vector<KnownView> views_;
  std::vector<std::size_t> view_of_frame_;
  std::vector<Place> places_;  // of each frame
};

// Only blanks and comments may follow.
void expect_end(TextRecords& in) {
  if (in.has_word() || in.next_record()) {
    in.refuse("end", "there is more behind the last record", "the end of the file");
  }
}

LandmarkMap read_named_bundler(ByteSource& source, std::span<const std::string> names,
                               const Execution& execution) {
  ReadingProgress progress(execution, source.size().value_or(0));
  TextRecords in(source, progress);
  Words words(in);
  BundleReader out(source, execution);
  const std::uint64_t cameras = words.count("number of cameras");
  const std::uint64_t points = words.count("number of points");
  if (!names.empty() && names.size() != cameras) {
    out.log().lost(fmt::format(
        "the list of images beside it names {}, but there are {} cameras: names are left out",
        names.size(), cameras));
  }
  for (std::uint64_t i = 0; i < cameras; ++i) {
    View view;
    view.focal = words.number("focal length");
    view.k1 = words.number("k1");
    view.k2 = words.number("k2");
    Eigen::Matrix3d rotation;
    for (int j = 0; j < 9; ++j) rotation(j / 3, j % 3) = words.number("rotation");
    const Eigen::Vector3d translation = words.vector3("translation");
    if (view.focal == 0.0 || rotation.isZero()) {
      out.add_unregistered();
      continue;
    }
    if (!is_rotation(rotation)) {
      in.refuse(fmt::format("rotation of camera {}", i), "is none", "a rotation matrix");
    }
    // The camera looks along -z with y up.
    const Eigen::Vector3d axes(1.0, -1.0, -1.0);
    const Eigen::Matrix3d camera_from_world = axes.asDiagonal() * rotation;
    view.frame = frame_from_inverse({}, Eigen::Quaterniond(camera_from_world).normalized(),
                                    axes.asDiagonal() * translation);
    if (names.size() == cameras) view.frame.image_name = names[i];
    out.add_view(in, std::move(view));
  }
  for (std::uint64_t i = 0; i < points; ++i) out.read_point(in, words, -1.0);
  expect_end(in);
  return std::move(out).finish();
}

// The names in a list of images, one a line; Bundler's may be followed by "0 FOCAL".
std::vector<std::string> read_image_list(ByteSource& source) {
  LineReader lines(source);
  std::vector<std::string> names;
  while (const auto next = lines.next()) {
    std::string_view line = trimmed(*next);
    if (line.empty()) continue;
    const std::vector<std::string_view> words = words_of(line);
    const std::size_t count = words.size();
    if (count > 2 && words[count - 2] == "0" && parse_number(words[count - 1])) {
      line =
          trimmed(line.substr(0, static_cast<std::size_t>(words[count - 2].data() - line.data())));
    }
    if (line.starts_with("./")) line.remove_prefix(2);
    names.emplace_back(line);
  }
  return names;
}

// The list of images to a Bundler file: list.txt beside it or, as Bundler has it, above the folder bundle; COLMAP has
// the names x.bundle.out and x.list.txt.
std::optional<std::filesystem::path> image_list_of(const std::filesystem::path& bundle) {
  std::error_code ignored;
  const std::filesystem::path folder = std::filesystem::absolute(bundle, ignored).parent_path();
  std::string stem = bundle.stem().string();
  if (stem.ends_with(".bundle")) stem.resize(stem.size() - std::string_view(".bundle").size());
  std::vector<std::filesystem::path> places = {folder / (stem + ".list.txt"), folder / "list.txt"};
  if (folder.filename() == "bundle") places.push_back(folder.parent_path() / "list.txt");
  const auto found = std::find_if(places.begin(), places.end(), &is_file);
  return found == places.end() ? std::nullopt : std::optional(*found);
}

// A camera's line of an NVM file: a name, which may have blanks, and ten numbers.
View nvm_view(TextRecords& in) {
  const std::string_view line = in.rest();
  const std::vector<std::string_view> words = words_of(line);
  constexpr std::size_t kNumbers = 10;
  if (words.size() <= kNumbers) {
    in.refuse("camera", fmt::format("{} words", words.size()), "a file name and 10 numbers");
  }
  std::array<double, kNumbers> numbers{};
  for (std::size_t j = 0; j < kNumbers; ++j) {
    const std::string_view word = words[words.size() - kNumbers + j];
    const auto value = parse_number(word);
    if (!value) in.refuse("camera", printable(word) + " is not a number", "a decimal number");
    numbers[j] = *value;
  }
  View view;
  const std::string_view last = words[words.size() - kNumbers - 1];
  view.frame.image_name =
      line.substr(0, static_cast<std::size_t>(last.data() + last.size() - line.data()));
  view.focal = numbers[0];
  const Eigen::Quaterniond camera_from_world(numbers[1], numbers[2], numbers[3], numbers[4]);
  if (!has_direction(camera_from_world)) in.refuse("quaternion", "has no direction", "norm 1");
  view.frame.world_from_camera = camera_from_world.conjugate().normalized();
  view.frame.centre = {numbers[5], numbers[6], numbers[7]};
  view.measured_k = numbers[8];
  return view;
}

// --- Writing --------------------------------------------------------------------------------------

class BundlerWriter {
 public:
  BundlerWriter(const LandmarkMap& map, const ByteSink& sink)
      : map_(map), out_(sink), keypoints_(keypoint_indices(map)) {
    require_cameras(map, "a camera of Bundler");
  }

  void write() {
    out_.line("# Bundle file v0.3");
    out_.words(map_.frame_count(), map_.landmark_count());
    out_.line();
    for (std::uint32_t i = 0; i < map_.frame_count(); ++i) write_camera(FrameIndex{i});
    for (std::uint32_t i = 0; i < map_.landmark_count(); ++i) write_point(LandmarkIndex{i});
    out_.flush();
  }

  void remark(const LogSink& log) const {
    log_losses(log, map_, {.image_sizes = false, .image_names = false, .keypoints = true},
               "Bundler");
    const auto lost = [&](std::size_t count, std::string_view text) {
      if (log && count > 0) {
        log({fmt::format("Bundler: {} observations {}", count, text), RemarkKind::kLoss});
      }
    };
    lost(undistorted_, "are written undistorted: Bundler has no distortion of that kind");
    lost(folded_, "without a line of sight are left out");
  }

 private:
  void write_camera(FrameIndex frame) {
    const Camera& written = camera_of(map_, frame);
    const auto radial =
        radial_camera(written).value_or(RadialCamera{intrinsics(written).fx, 0.0, 0.0});
    out_.words(radial.focal, radial.k1, radial.k2);
    out_.line();
    const Eigen::Vector3d axes(1.0, -1.0, -1.0);  // it looks along -z with y up
    const Rigid3 camera_from_world = map_.world_from_camera(frame).inverse();
    const Eigen::Matrix3d rotation = axes.asDiagonal() * camera_from_world.rotation();
    const Eigen::Vector3d translation = axes.asDiagonal() * camera_from_world.translation();
    for (int row = 0; row < 3; ++row) {
      out_.words(rotation(row, 0), rotation(row, 1), rotation(row, 2));
      out_.line();
    }
    out_.words(translation.x(), translation.y(), translation.z());
    out_.line();
  }

  void write_point(LandmarkIndex landmark) {
    const Eigen::Vector3d& x = map_.landmarks().positions[landmark.value];
    out_.words(x.x(), x.y(), x.z());
    out_.line();
    const Color color = color_of(map_, landmark.value);
    out_.words(color.red, color.green, color.blue);
    out_.line();
    const auto frames = map_.observing_frames(landmark);
    const std::uint64_t first = frames.empty() ? 0 : map_.observations().offsets[landmark.value];
    std::vector<std::pair<std::uint64_t, Pixel>> seen;
    for (std::size_t j = 0; j < frames.size(); ++j) {
      const auto offset =
          offset_of(camera_of(map_, frames[j]), map_.observations().pixels[first + j]);
      if (offset) {
        seen.emplace_back(first + j, *offset);
      } else {
        ++folded_;
      }
    }
    out_.words(seen.size());
    for (const auto& [k, offset] : seen) {
      out_.words(map_.observations().frames[k].value, keypoints_[k], offset.u, -offset.v);
    }
    out_.line();
  }

  std::optional<Pixel> offset_of(const Camera& camera, const Pixel& pixel) {
    if (radial_camera(camera)) {
      const Intrinsics k = intrinsics(camera);
      return Pixel{pixel.u - k.cx, pixel.v - k.cy};
    }
    ++undistorted_;
    return undistorted_offset(camera, pixel);
  }

  const LandmarkMap& map_;
  TextOutput out_;
  std::vector<std::uint32_t> keypoints_;
  std::size_t undistorted_ = 0;
  std::size_t folded_ = 0;
};

}  // namespace

LandmarkMap read_bundler(ByteSource& source, const Execution& execution) {
  return read_named_bundler(source, {}, execution);
}

LandmarkMap read_bundler_and_list(const MapInput& input, const Execution& execution) {
  std::vector<std::string> names;
  if (const auto list = image_list_of(input.path)) {
    FileReader file(*list);
    names = read_image_list(file);
  }
  return read_named_bundler(*input.source, names, execution);
}

LandmarkMap read_nvm(ByteSource& source, const Execution& execution) {
  ReadingProgress progress(execution, source.size().value_or(0));
  TextRecords in(source, progress);
  BundleReader out(source, execution);
  if (!in.next_record() || !in.word("first word").starts_with("NVM_V3")) {
    in.refuse("first word", "is not NVM_V3", "NVM_V3");
  }
  in.rest();  // a common calibration; ignored, because each camera states its focal length
  const auto count = [&](std::string_view field) {
    if (!in.next_record()) in.refuse(field, "the file ends before it", "a count");
    const std::uint64_t value = in.unsigned_number(field, kMostViews);
    in.expect_line_end();
    return value;
  };
  const std::uint64_t cameras = count("number of cameras");
  for (std::uint64_t i = 0; i < cameras; ++i) {
    if (!in.next_record()) in.refuse("camera", "the file ends before it", "one line a camera");
    out.add_view(in, nvm_view(in));
  }
  const std::uint64_t points = count("number of points");
  Words words(in, false);
  for (std::uint64_t i = 0; i < points; ++i) {
    if (!in.next_record()) in.refuse("point", "the file ends before it", "one line a point");
    out.read_point(in, words, 1.0);
    in.expect_line_end();
  }
  // Further models follow, each with the number of its cameras first; the last has none.
  if (in.next_record() && in.has_word() && in.unsigned_number("number of cameras") > 0) {
    out.log().lost("holds further models; the first is read");
  }
  return std::move(out).finish(true);
}

void write_bundler(const LandmarkMap& map, const ByteSink& sink, const Execution& execution) {
  BundlerWriter writer(map, sink);
  writer.write();
  writer.remark(execution.log);
}

}  // namespace cairn::detail
