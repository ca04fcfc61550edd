// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/foreign/bundle_files.hpp"

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
#include "cairn/core/text.hpp"
#include "cairn/formats/detail/bytes/record_reader.hpp"
#include "cairn/formats/detail/foreign/is_file.hpp"
#include "cairn/formats/detail/foreign/observation_list.hpp"
#include "cairn/formats/detail/foreign/pixel_centre.hpp"
#include "cairn/formats/detail/foreign/written_frames.hpp"
#include "cairn/formats/losses.hpp"

namespace cairn {
namespace {

using detail::kPixelCentre;
using detail::ReadingProgress;
using detail::TextRecords;

constexpr double kFarthest = 1e9;  // pixels; larger than any image
constexpr std::uint64_t kMost = std::numeric_limits<std::uint32_t>::max() - 1;

// One camera of such a file, in Cairn's axes: x right, y down, z forward.
struct View {
  Eigen::Quaterniond world_from_camera = Eigen::Quaterniond::Identity();
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double focal = 0.0;
  double k1 = 0.0;
  double k2 = 0.0;
  /// VisualSFM's distortion of the measurement: m becomes m (1 + k |m|² / focal²).
  double measured_k = 0.0;
  std::string name;

  /// A measurement without VisualSFM's distortion.
  Pixel undistorted(Pixel measured) const {
    if (measured_k == 0.0 || focal == 0.0) return measured;
    const double r2 = (measured.u * measured.u + measured.v * measured.v) / (focal * focal);
    return {measured.u * (1.0 + measured_k * r2), measured.v * (1.0 + measured_k * r2)};
  }
  /// Where a point appears, in pixels right and down of the principal point; std::nullopt if it is behind the camera.
  std::optional<Eigen::Vector2d> offset_of(const Eigen::Vector3d& point, double k) const {
    const Eigen::Vector3d x = world_from_camera.conjugate() * (point - centre);
    if (!(x.z() > 0.0)) return std::nullopt;
    const Eigen::Vector2d p = x.head<2>() / x.z();
    return focal * (1.0 + k * p.squaredNorm()) * p;
  }
};

double median_of(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// The middle of values to which an image's size, a whole number, gives half pixels: the nearest of these, unless the
// values contradict it.
double middle_of(const std::vector<double>& values) {
  const double median = median_of(values);
  std::vector<double> deviations;
  for (const double value : values) deviations.push_back(std::abs(value - median));
  const double error = 1.25 * 1.4826 * median_of(std::move(deviations)) /
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
    return in_.unsigned_number(field, kMost);
  }
  std::uint8_t channel(std::string_view field) {
    const double value = number(field);
    return static_cast<std::uint8_t>(std::lround(std::clamp(value, 0.0, 255.0)));
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

class Builder {
 public:
  Builder(ByteSource& source, const MapReadOptions& options) : source_(source), options_(options) {}

  /// A camera that was never registered has no frame.
  void add_unregistered() {
    frame_of_view_.push_back(kNoFrame);
    views_.emplace_back();
  }

  void add_view(const TextRecords& in, View view) {
    if (!view.centre.allFinite()) in.refuse("pose", "the position is not finite", "numbers");
    FrameTable& frames = tables_.frames;
    frame_of_view_.push_back(static_cast<std::uint32_t>(frames.ids.size()));
    const Eigen::Quaterniond q = view.world_from_camera.normalized();
    frames.ids.push_back(FrameId{views_.size()});
    frames.quaternions.push_back({q.w(), q.x(), q.y(), q.z()});
    frames.translations.push_back(view.centre);
    frames.image_names.push_back(view.name);
    views_.push_back(std::move(view));
  }

  std::size_t view_count() const { return views_.size(); }

  std::uint32_t add_point(const Eigen::Vector3d& position, std::optional<Color> color) {
    LandmarkTable& landmarks = tables_.landmarks;
    landmarks.ids.push_back(LandmarkId{landmarks.ids.size()});
    landmarks.positions.push_back(position);
    landmarks.colors.push_back(color);
    return static_cast<std::uint32_t>(landmarks.ids.size() - 1);
  }

  /// @param right, down of the centre of the image, in pixels
  void add_observation(const TextRecords& in, std::uint32_t landmark, std::uint64_t view,
                       double right, double down, std::optional<std::uint32_t> keypoint) {
    if (view >= views_.size()) {
      in.refuse("camera of an observation", fmt::format("{} of {}", view, views_.size()),
                "a camera of the file");
    }
    if (frame_of_view_[view] == kNoFrame) {
      in.refuse("camera of an observation", fmt::format("camera {} has no pose", view),
                "a registered camera");
    }
    for (const Pixel& pixel : {Pixel{right, down}, views_[view].undistorted({right, down})}) {
      if (std::abs(pixel.u) <= kFarthest && std::abs(pixel.v) <= kFarthest) continue;
      in.refuse("observation", fmt::format("({}, {}) is in no image", pixel.u, pixel.v), "pixels");
    }
    observations_.add(landmark, FrameIndex{frame_of_view_[view]}, {right, down}, keypoint);
  }

  void remark(const std::string& text) const {
    detail::log_remark(options_.log, source_.name(), text);
  }
  void lost(const std::string& text) const {
    detail::log_remark(options_.log, source_.name(), text, RemarkKind::kLoss);
  }

  /// @param may_count_from_corner whether programs write measurements in this format from the image's corner
  LandmarkMap finish(bool may_count_from_corner = false) && {
    observations_.fill(tables_.observations, tables_.landmarks.ids.size());
    if (!may_count_from_corner || !count_from_corner()) count_from_principal_point();
    make_cameras();
    if (!tables_.cameras.empty()) {
      tables_.info.provenance.emplace_back(detail::kSizesNotStated);
    }
    tables_.info.length_unit = LengthUnit::kFree;
    return detail::imported_map(std::move(tables_), source_.name(), options_.log);
  }

 private:
  static constexpr std::uint32_t kNoFrame = std::numeric_limits<std::uint32_t>::max();

  // Of a frame: what is added to the measurements to get pixels, and its principal point and size.
  struct Place {
    double shift_u = 0.0;
    double shift_v = 0.0;
    double cx = 0.0;
    double cy = 0.0;
    double width = 0.0;
    double height = 0.0;
  };

  const View& view_of(FrameIndex frame) const {
    return views_[tables_.frames.ids[frame.value].value];
  }

  // Measurements are relative to the principal point: gives each image the smallest size that holds them.
  void count_from_principal_point() {
    ObservationTable& observations = tables_.observations;
    std::size_t undistorted = 0;
    places_.resize(tables_.frames.ids.size());
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
    for (Place& place : places_) {
      place = {place.cx, place.cy, place.cx, place.cy, 2.0 * place.cx + 1.0, 2.0 * place.cy + 1.0};
    }
    if (!places_.empty()) {
      remark("states no image sizes: each camera has the smallest that holds its observations");
    }
    if (undistorted > 0) {
      remark(fmt::format(
          "{} observations are undistorted: VisualSFM's distortion, of the measurement, "
          "is no camera model of Cairn's",
          undistorted));
    }
  }

  // COLMAP writes NVM with measurements from the image's corner, and a distortion of opposite sign. Few are negative then
  // (of undistorted images), and they show the principal point, which is half the size of the image.
  // @return false if they are relative to the principal point, as the format says
  bool count_from_corner() {
    ObservationTable& observations = tables_.observations;
    constexpr std::size_t kFewest = 8;
    std::vector<Pixel> most(tables_.frames.ids.size());  // of each frame
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
    std::uint32_t landmark = 0;
    for (std::size_t i = 0; i < observations.frames.size(); ++i) {
      while (observations.offsets[landmark + 1] <= i) ++landmark;
      const FrameIndex frame = observations.frames[i];
      const View& view = view_of(frame);
      const Eigen::Vector3d& point = tables_.landmarks.positions[landmark];
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
      auto& of_key = principal_points[key_of(frame)];
      of_key[0].push_back(shown.u);
      of_key[1].push_back(shown.v);
    }
    // The middle of what was observed is a rough principal point, but the corner is none at all.
    if (from_corner.size() < kFewest ||
        3.0 * median_of(from_corner) >= median_of(from_principal_point)) {
      return false;
    }
    for (std::uint32_t i = 0; i < most.size(); ++i) {
      const auto& [us, vs] = principal_points[key_of(FrameIndex{i})];
      const Pixel centre = us.size() >= kFewest ? Pixel{middle_of(us), middle_of(vs)}
                                                : Pixel{0.5 * most[i].u, 0.5 * most[i].v};
      // The centre of the first pixel is (0.5, 0.5) for COLMAP.
      places_.push_back({-kPixelCentre, -kPixelCentre, centre.u - kPixelCentre,
                         centre.v - kPixelCentre,
                         std::max(std::round(2.0 * centre.u), std::floor(most[i].u) + 1.0),
                         std::max(std::round(2.0 * centre.v), std::floor(most[i].v) + 1.0)});
    }
    for (View& view : views_) view.k1 = 0.0 - std::exchange(view.measured_k, 0.0);
    remark(
        "measurements are from the corner of the images, as COLMAP writes them; the file states no "
        "image sizes: principal points and sizes are those that the points show");
    return true;
  }

  void make_cameras() {
    ObservationTable& observations = tables_.observations;
    FrameTable& frames = tables_.frames;
    std::size_t unknown = 0;
    for (std::uint32_t i = 0; i < frames.ids.size(); ++i) {
      const View& v = view_of(FrameIndex{i});
      const Place& place = places_[i];
      const Camera camera{CameraId{frames.ids[i].value},
                          "RADIAL",
                          static_cast<std::uint32_t>(place.width),
                          static_cast<std::uint32_t>(place.height),
                          {v.focal, place.cx, place.cy, v.k1, v.k2}};
      if (!camera_defect(camera).empty()) {
        ++unknown;
        frames.cameras.emplace_back();
        continue;
      }
      frames.cameras.emplace_back(CameraIndex{static_cast<std::uint32_t>(tables_.cameras.size())});
      tables_.cameras.push_back(camera);
    }
    for (std::size_t i = 0; i < observations.frames.size(); ++i) {
      observations.pixels[i].u += places_[observations.frames[i].value].shift_u;
      observations.pixels[i].v += places_[observations.frames[i].value].shift_v;
    }
    if (unknown > 0)
      lost(fmt::format("{} cameras are unknown to the map: their model is none of Cairn's",
                       unknown));
  }

  ByteSource& source_;
  const MapReadOptions& options_;
  MapTables tables_;
  std::vector<View> views_;
  std::vector<std::uint32_t> frame_of_view_;
  detail::ObservationList observations_;
  std::vector<Place> places_;  // of each frame
};

// The pose of a camera that looks along -z with y up: rotation and translation camera_from_world.
void set_upright_pose(View& view, const Eigen::Matrix3d& rotation,
                      const Eigen::Vector3d& translation) {
  const Eigen::Vector3d axes(1.0, -1.0, -1.0);
  const Eigen::Matrix3d camera_from_world = axes.asDiagonal() * rotation;
  const Eigen::Vector3d t = axes.asDiagonal() * translation;
  view.world_from_camera = Eigen::Quaterniond(camera_from_world).conjugate().normalized();
  view.centre = -(view.world_from_camera * t);
}

bool is_rotation(const Eigen::Matrix3d& matrix) {
  constexpr double kTolerance = 1e-3;
  return ((matrix * matrix.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() <
          kTolerance) &&
         matrix.determinant() > 0.0;
}

// A point with its colour and observations.
// @param down 1 if y points down in the image, -1 if up
void read_point(const TextRecords& in, Words& words, double down, Builder& out) {
  const Eigen::Vector3d position = words.vector3("position");
  Color color;
  color.red = words.channel("red");
  color.green = words.channel("green");
  color.blue = words.channel("blue");
  const std::uint32_t landmark = out.add_point(position, color);
  const std::uint64_t views = words.count("number of views");
  for (std::uint64_t i = 0; i < views; ++i) {
    const std::uint64_t camera = words.count("camera of an observation");
    const auto key = static_cast<std::uint32_t>(words.count("key of an observation"));
    const double x = words.number("x of an observation");
    const double y = words.number("y of an observation");
    out.add_observation(in, landmark, camera, x, down * y, key);
  }
}

// Only blanks and comments may follow.
void expect_end(TextRecords& in) {
  if (in.has_word() || in.next_record()) {
    in.refuse("end", "there is more behind the last record", "the end of the file");
  }
}

std::vector<std::string_view> words_of(std::string_view line) {
  std::vector<std::string_view> words;
  for (line = trimmed(line); !line.empty(); line = trimmed(line)) {
    const std::size_t end = std::min(line.find_first_of(kBlanks), line.size());
    words.push_back(line.substr(0, end));
    line.remove_prefix(end);
  }
  return words;
}

// A problem starts with three counts, then two indices and two numbers.
bool looks_like_bal(std::string_view bytes) {
  std::vector<std::vector<std::string_view>> lines;
  while (lines.size() < 2 && !bytes.empty()) {
    const std::size_t end = bytes.find('\n');
    if (end == std::string_view::npos) return false;
    auto words = words_of(bytes.substr(0, end));
    if (!words.empty()) lines.push_back(std::move(words));
    bytes.remove_prefix(end + 1);
  }
  const auto are_counts = [](const std::vector<std::string_view>& words, std::size_t count) {
    return std::all_of(words.begin(), words.begin() + static_cast<std::ptrdiff_t>(count),
                       [](std::string_view word) { return parse_unsigned(word).has_value(); });
  };
  return lines.size() == 2 && lines[0].size() == 3 && lines[1].size() == 4 &&
         are_counts(lines[0], 3) && are_counts(lines[1], 2) && parse_number(lines[1][2]) &&
         parse_number(lines[1][3]);
}

MapFormat text_format(std::string name, std::string title, std::vector<std::string> endings,
                      std::function<bool(std::string_view first_bytes)> recognises,
                      LandmarkMap (*read)(ByteSource&, const MapReadOptions&),
                      void (*write)(const LandmarkMap&, const ByteSink&,
                                    const MapWriteOptions&) = nullptr) {
  MapFormat format{
      .name = std::move(name),
      .title = std::move(title),
      .endings = std::move(endings),
      .recognises =
          [recognises](const MapInput& input) {
            return input.source != nullptr && recognises(input.first_bytes);
          },
      .read = [read](const MapInput& input,
                     const MapReadOptions& options) { return read(*input.source, options); }};
  if (write != nullptr) format.write_to = write;
  return format;
}

// --- Writing --------------------------------------------------------------------------------------

// Shared by both writers: the map's data and the output.
class BundleWriter {
 public:
  BundleWriter(const LandmarkMap& map, const ByteSink& sink, std::string_view image)
      : map_(map), sink_(sink), keypoints_(detail::keypoint_indices(map)) {
    detail::require_cameras(map, image);
  }

  void number(double value) {
    separate();
    append_number(text_, value);
  }
  void count(std::uint64_t value) {
    separate();
    append_number(text_, value);
  }
  void word(std::string_view word) {
    separate();
    text_ += word;
  }
  void line(std::string_view text = {}) {
    text_ += text;
    text_ += '\n';
    begins_ = true;
    constexpr std::size_t kLarge = std::size_t{1} << 20;
    if (text_.size() >= kLarge) flush();
  }
  void flush() {
    sink_(text_);
    text_.clear();
  }

  const Camera& camera(FrameIndex frame) const {
    return map_.cameras()[map_.frames().cameras[frame.value]->value];
  }

  // Bundler has three lines per point, y upwards, and unchanged pixels for radial cameras; NVM has one line.
  void points(bool is_bundler) {
    const double down = is_bundler ? -1.0 : 1.0;
    for (std::uint32_t i = 0; i < map_.landmark_count(); ++i) {
      const Eigen::Vector3d& x = map_.landmarks().positions[i];
      for (int j = 0; j < 3; ++j) number(x[j]);
      if (is_bundler) line();
      const auto& colors = map_.landmarks().colors;
      const Color color = colors.empty() ? Color{} : colors[i].value_or(Color{});
      for (const std::uint8_t channel : {color.red, color.green, color.blue}) count(channel);
      if (is_bundler) line();
      const auto frames = map_.observing_frames(LandmarkIndex{i});
      const std::uint64_t first = frames.empty() ? 0 : map_.observations().offsets[i];
      std::vector<std::pair<std::uint64_t, Pixel>> seen;
      for (std::size_t j = 0; j < frames.size(); ++j) {
        const auto offset =
            offset_of(camera(frames[j]), map_.observations().pixels[first + j], is_bundler);
        if (offset) {
          seen.emplace_back(first + j, *offset);
        } else {
          ++folded_;
        }
      }
      count(seen.size());
      for (const auto& [k, offset] : seen) {
        count(map_.observations().frames[k].value);
        count(keypoints_[k]);
        number(offset.u);
        number(down * offset.v);
      }
      line();
    }
  }

  void remark(const MapWriteOptions& options, const detail::Holdings& holdings,
              std::string_view format) const {
    if (!options.log) return;
    const std::string lost = detail::loss_remark(map_, holdings, "", format);
    if (!lost.empty()) options.log({lost, RemarkKind::kLoss});
    if (undistorted_ > 0) {
      options.log({fmt::format("{}: {} observations are written undistorted: {} has no distortion "
                               "of that kind",
                               format, undistorted_, format),
                   RemarkKind::kLoss});
    }
    if (folded_ > 0) {
      options.log(
          {fmt::format("{}: {} observations without a line of sight are left out", format, folded_),
           RemarkKind::kLoss});
    }
  }

 private:
  void separate() {
    if (!begins_) text_ += ' ';
    begins_ = false;
  }

  std::optional<Pixel> offset_of(const Camera& camera, const Pixel& pixel, bool keep_distortion) {
    const auto radial = detail::radial_camera(camera);
    const bool is_plain = radial && radial->k1 == 0.0 && radial->k2 == 0.0;
    if (is_plain || (radial && keep_distortion)) {
      const Intrinsics k = intrinsics(camera);
      return Pixel{pixel.u - k.cx, pixel.v - k.cy};
    }
    ++undistorted_;
    return detail::undistorted_offset(camera, pixel);
  }

  const LandmarkMap& map_;
  const ByteSink& sink_;
  std::vector<std::uint32_t> keypoints_;
  std::string text_;
  bool begins_ = true;
  std::size_t undistorted_ = 0;
  std::size_t folded_ = 0;
};

LandmarkMap read_named_bundler(ByteSource& source, std::span<const std::string> names,
                               const MapReadOptions& options) {
  ReadingProgress progress(options, source.size().value_or(0));
  TextRecords in(source, progress);
  Words words(in);
  Builder out(source, options);
  const std::uint64_t cameras = words.count("number of cameras");
  const std::uint64_t points = words.count("number of points");
  if (!names.empty() && names.size() != cameras) {
    out.lost(fmt::format(
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
    if (names.size() == cameras) view.name = names[i];
    if (view.focal == 0.0 || rotation.isZero()) {
      out.add_unregistered();
      continue;
    }
    if (!is_rotation(rotation))
      in.refuse(fmt::format("rotation of camera {}", i), "is none", "a rotation matrix");
    set_upright_pose(view, rotation, translation);
    out.add_view(in, std::move(view));
  }
  for (std::uint64_t i = 0; i < points; ++i) read_point(in, words, -1.0, out);
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
  const auto found = std::find_if(places.begin(), places.end(), &detail::is_file);
  return found == places.end() ? std::nullopt : std::optional(*found);
}

LandmarkMap read_bundler_and_list(const MapInput& input, const MapReadOptions& options) {
  std::vector<std::string> names;
  if (const auto list = image_list_of(input.path)) {
    FileReader file(*list);
    names = read_image_list(file);
  }
  return read_named_bundler(*input.source, names, options);
}

}  // namespace

LandmarkMap read_bundler(ByteSource& source, const MapReadOptions& options) {
  return read_named_bundler(source, {}, options);
}

LandmarkMap read_bal(ByteSource& source, const MapReadOptions& options) {
  ReadingProgress progress(options, source.size().value_or(0));
  TextRecords in(source, progress);
  Words words(in);
  Builder out(source, options);
  const std::uint64_t cameras = words.count("number of cameras");
  const std::uint64_t points = words.count("number of points");
  const std::uint64_t count = words.count("number of observations");
  struct Observation {
    std::uint32_t camera;
    std::uint32_t point;
    double x;
    double y;
  };
  std::vector<Observation> observations;
  for (std::uint64_t i = 0; i < count; ++i) {
    Observation o{};
    o.camera = static_cast<std::uint32_t>(words.count("camera of an observation"));
    o.point = static_cast<std::uint32_t>(words.count("point of an observation"));
    o.x = words.number("x of an observation");
    o.y = words.number("y of an observation");
    if (o.camera >= cameras || o.point >= points) {
      in.refuse("observation", fmt::format("of point {} by camera {}", o.point, o.camera),
                fmt::format("{} points and {} cameras, counted from 0", points, cameras));
    }
    observations.push_back(o);
  }
  for (std::uint64_t i = 0; i < cameras; ++i) {
    const Eigen::Vector3d rotation = words.vector3("rotation");
    const Eigen::Vector3d translation = words.vector3("translation");
    View view;
    view.focal = words.number("focal length");
    view.k1 = words.number("k1");
    view.k2 = words.number("k2");
    const double angle = rotation.norm();
    if (!std::isfinite(angle)) in.refuse("rotation", "is out of range", "radians");
    const Eigen::AngleAxisd turn(
        angle, angle > 0.0 ? Eigen::Vector3d(rotation / angle) : Eigen::Vector3d::UnitX());
    set_upright_pose(view, turn.toRotationMatrix(), translation);
    out.add_view(in, std::move(view));
  }
  for (std::uint64_t i = 0; i < points; ++i) out.add_point(words.vector3("position"), {});
  expect_end(in);
  for (const Observation& o : observations) {
    out.add_observation(in, o.point, o.camera, o.x, -o.y, {});
  }
  return std::move(out).finish();
}

LandmarkMap read_nvm(ByteSource& source, const MapReadOptions& options) {
  ReadingProgress progress(options, source.size().value_or(0));
  TextRecords in(source, progress);
  Builder out(source, options);
  if (!in.next_record() || !in.word("first word").starts_with("NVM_V3")) {
    in.refuse("first word", "is not NVM_V3", "NVM_V3");
  }
  in.rest();  // a common calibration; ignored, because each camera states its focal length
  const auto count = [&](std::string_view field) {
    if (!in.next_record()) in.refuse(field, "the file ends before it", "a count");
    const std::uint64_t value = in.unsigned_number(field, kMost);
    in.expect_line_end();
    return value;
  };
  const std::uint64_t cameras = count("number of cameras");
  for (std::uint64_t i = 0; i < cameras; ++i) {
    if (!in.next_record()) in.refuse("camera", "the file ends before it", "one line a camera");
    const std::string_view line = in.rest();
    const std::vector<std::string_view> words = words_of(line);
    constexpr std::size_t kNumbers = 10;  // behind a name, which may have blanks
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
    view.name = std::string(
        line.substr(0, static_cast<std::size_t>(last.data() + last.size() - line.data())));
    view.focal = numbers[0];
    const Eigen::Quaterniond camera_from_world(numbers[1], numbers[2], numbers[3], numbers[4]);
    const double norm = camera_from_world.norm();
    if (!(norm > 1e-6) || !(norm < 1e6)) in.refuse("quaternion", "has no direction", "norm 1");
    view.world_from_camera = camera_from_world.conjugate().normalized();
    view.centre = {numbers[5], numbers[6], numbers[7]};
    view.measured_k = numbers[8];
    out.add_view(in, std::move(view));
  }
  const std::uint64_t points = count("number of points");
  Words words(in, false);
  for (std::uint64_t i = 0; i < points; ++i) {
    if (!in.next_record()) in.refuse("point", "the file ends before it", "one line a point");
    read_point(in, words, 1.0, out);
    in.expect_line_end();
  }
  // Further models follow, each with the number of its cameras first; the last has none.
  if (in.next_record() && in.has_word() && in.unsigned_number("number of cameras") > 0) {
    out.lost("holds further models; the first is read");
  }
  return std::move(out).finish(true);
}

void write_bundler(const LandmarkMap& map, const ByteSink& sink, const MapWriteOptions& options) {
  BundleWriter out(map, sink, "a camera of Bundler");
  out.line("# Bundle file v0.3");
  out.count(map.frame_count());
  out.count(map.landmark_count());
  out.line();
  const Eigen::Vector3d axes(1.0, -1.0, -1.0);  // it looks along -z with y up
  for (std::uint32_t i = 0; i < map.frame_count(); ++i) {
    const Camera& camera = out.camera(FrameIndex{i});
    const auto radial = detail::radial_camera(camera).value_or(
        detail::RadialCamera{intrinsics(camera).fx, 0.0, 0.0});
    for (const double x : {radial.focal, radial.k1, radial.k2}) out.number(x);
    out.line();
    const Rigid3 camera_from_world = map.world_from_camera(FrameIndex{i}).inverse();
    const Eigen::Matrix3d rotation = axes.asDiagonal() * camera_from_world.rotation();
    const Eigen::Vector3d translation = axes.asDiagonal() * camera_from_world.translation();
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) out.number(rotation(row, column));
      out.line();
    }
    for (int j = 0; j < 3; ++j) out.number(translation[j]);
    out.line();
  }
  out.points(true);
  out.flush();
  out.remark(options, {.image_sizes = false, .image_names = false, .keypoints = true}, "Bundler");
}

void write_nvm(const LandmarkMap& map, const ByteSink& sink, const MapWriteOptions& options) {
  BundleWriter out(map, sink, "a camera of NVM");
  out.line("NVM_V3");
  out.line();
  out.count(map.frame_count());
  out.line();
  const std::vector<std::string> names = detail::image_names(map);
  for (std::uint32_t i = 0; i < map.frame_count(); ++i) {
    const std::string& name = names[i];
    if (name.find_first_of("\n\r\t") != std::string::npos || name.starts_with(' ')) {
      throw Error(ErrorKind::kInput, fmt::format("frame {}", map.frames().ids[i].value),
                  "image name " + printable(name), "a name of one line");
    }
    out.word(name);
    out.number(intrinsics(out.camera(FrameIndex{i})).fx);
    const auto& q = map.frames().quaternions[i];
    out.number(q[0]);
    for (std::size_t j = 1; j < 4; ++j) out.number(-q[j]);
    for (int j = 0; j < 3; ++j) out.number(map.frames().translations[i][j]);
    out.number(0.0);
    out.number(0.0);
    out.line();
  }
  out.line();
  out.count(map.landmark_count());
  out.line();
  out.points(false);
  out.line();
  out.line("0");
  out.flush();
  out.remark(options, {.image_sizes = false, .keypoints = true}, "NVM");
}

std::vector<MapFormat> bundle_file_formats() {
  const auto starts_with = [](std::string_view text) {
    return [text](std::string_view bytes) { return bytes.starts_with(text); };
  };
  MapFormat bundler = text_format("bundler", "Bundler", {".out"}, starts_with("# Bundle file v0.3"),
                                  nullptr, &write_bundler);
  bundler.read = &read_bundler_and_list;
  return {std::move(bundler), text_format("bal", "BAL", {}, &looks_like_bal, &read_bal),
          text_format("nvm", "NVM", {".nvm"}, starts_with("NVM_V3"), &read_nvm, &write_nvm)};
}

}  // namespace cairn
