// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/report/frame_images.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <system_error>
#include <tuple>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cairn/core/error.hpp"
#include "cairn/core/statistics.hpp"
#include "cairn/core/text.hpp"
#include "cairn/map/camera.hpp"
#include "cairn/registration/neighbors/batch_tree.hpp"
#include "cairn/report/detail/map_builder.hpp"
#include "cairn/vision/image.hpp"
#include "cairn/vision/sequence.hpp"

namespace cairn::report {
namespace {

// A frame of a map and its image.
struct SeenFrame {
  std::size_t frame;
  std::optional<std::size_t> image;  // of a sequence; std::nullopt: the file of the frame's name
};

double median_interval_s(std::span<const SequenceFrame> images) {
  std::vector<double> intervals;
  for (std::size_t i = 1; i < images.size(); ++i) {
    intervals.push_back(images[i].timestamp_s - images[i - 1].timestamp_s);
  }
  return intervals.empty() ? 0.0 : upper_median(intervals);
}

// The frames with an image that is near in time.
std::vector<SeenFrame> seen_frames(const LandmarkMap& map, std::span<const SequenceFrame> images) {
  const double most = 0.5 * median_interval_s(images);
  std::vector<SeenFrame> seen;
  std::size_t frame = 0;
  for (const auto& time : map.frames().timestamps_s) {
    const std::size_t index = frame++;
    if (!time) continue;
    const auto distance = [&](const SequenceFrame& image) {
      return std::abs(image.timestamp_s - *time);
    };
    auto nearest = std::lower_bound(
        images.begin(), images.end(), *time,
        [](const SequenceFrame& image, double wanted) { return image.timestamp_s < wanted; });
    if (nearest == images.end() ||
        (nearest != images.begin() && distance(*std::prev(nearest)) <= distance(*nearest))) {
      --nearest;
    }
    if (distance(*nearest) <= most) {
      seen.push_back({index, static_cast<std::size_t>(nearest - images.begin())});
    }
  }
  return seen;
}

// The images of keyframes: a sequence, or a folder of files that the maps name.
class ImageFolder {
 public:
  ImageFolder(std::filesystem::path folder, const LogSink& log) : folder_(std::move(folder)) {
    std::error_code ignored;
    // A sequence says what is wrong with a folder that does not exist.
    if (ImageSequence::is_in(folder_) || !std::filesystem::is_directory(folder_, ignored)) {
      sequence_.emplace(folder_, SequenceOptions(), log);
    }
  }

  std::vector<SeenFrame> seen(const LandmarkMap& map) const {
    std::vector<SeenFrame> seen;
    if (sequence_) seen = seen_frames(map, sequence_->frames());
    if (!seen.empty()) return seen;
    const std::vector<std::string>& names = map.frames().image_names;
    for (std::size_t i = 0; i < names.size(); ++i) {
      std::error_code ignored;
      const bool is_there =
          !names[i].empty() && std::filesystem::is_regular_file(folder_ / names[i], ignored);
      if (is_there) seen.push_back({i, std::nullopt});
    }
    return seen;
  }

  ColorImage read(const LandmarkMap& map, const SeenFrame& seen) const {
    return seen.image ? sequence_->read_color(*seen.image)
                      : read_color_image(folder_ / map.frames().image_names[seen.frame]);
  }

  // Of a map with no image here.
  [[noreturn]] void refuse(const LandmarkMap& map) const {
    if (!sequence_) {
      const std::vector<std::string>& names = map.frames().image_names;
      throw Error(ErrorKind::kInput, folder_.string(),
                  names.empty() ? "holds no sequence, and the map names no images"
                                : fmt::format("has none of the map's {} images, such as {}",
                                              names.size(), printable(names.front())),
                  "the sequence that the map was built from, or the folder of the images that it "
                  "names");
    }
    double first = std::numeric_limits<double>::infinity();
    double last = -first;
    for (const auto& time : map.frames().timestamps_s) {
      if (!time) continue;
      first = std::min(first, *time);
      last = std::max(last, *time);
    }
    const std::string frames =
        first <= last ? fmt::format("are from {:.3f} to {:.3f} s", first, last) : "have no times";
    const std::span<const SequenceFrame> images = sequence_->frames();
    throw Error(
        ErrorKind::kInput, folder_.string(),
        fmt::format("its images, from {:.3f} to {:.3f} s, fit no keyframe of the map: these {}",
                    images.front().timestamp_s, images.back().timestamp_s, frames),
        "the sequence that the map was built from, or the folder of the images that it names");
  }

 private:
  std::filesystem::path folder_;
  std::optional<ImageSequence> sequence_;
};

// At most `count` of them, from the first to the last.
std::vector<SeenFrame> spread(const std::vector<SeenFrame>& all, std::size_t count) {
  if (all.size() <= count) return all;
  std::vector<SeenFrame> some;
  for (std::size_t i = 0; i < count; ++i) {
    some.push_back(all[count == 1 ? all.size() / 2 : i * (all.size() - 1) / (count - 1)]);
  }
  return some;
}

// Makes small images without lens distortion of large ones.
class Shrinking {
 public:
  // The camera and its view, or neither: then the image is only made smaller.
  struct Lens {
    const Camera* camera;
    Frustum view;
  };

  Shrinking(const std::optional<Lens>& lens, std::uint32_t from_width, std::uint32_t from_height,
            std::uint32_t most_width)
      : width_(std::min(from_width, most_width)),
        samples_(std::min(kMostSamples, (from_width + width_ - 1) / width_)) {
    constexpr double kMostSlender = 8.0;
    const double shape = lens ? lens->view.half_height / lens->view.half_width
                              : static_cast<double>(from_height) / from_width;
    height_ = static_cast<std::uint32_t>(
        std::max(1.0, std::round(width_ * std::clamp(shape, 1.0 / kMostSlender, kMostSlender))));
    const auto projection = lens ? std::optional(CameraProjection(*lens->camera)) : std::nullopt;
    const auto place = [](std::uint32_t pixel, std::uint32_t sample, std::uint32_t samples) {
      return pixel + (sample + 0.5) / samples;
    };
    sources_.reserve(std::size_t{width_} * height_ * samples_ * samples_);
    for (std::uint32_t row = 0; row < height_; ++row) {
      for (std::uint32_t column = 0; column < width_; ++column) {
        for (std::uint32_t sample = 0; sample < samples_ * samples_; ++sample) {
          // From 0 to 1 over the small image, then over the large one.
          double u = place(column, sample % samples_, samples_) / width_;
          double v = place(row, sample / samples_, samples_) / height_;
          if (projection) {
            const auto pixel = (*projection)(lens->camera->parameters.data(),
                                             {(2.0 * u - 1.0) * lens->view.half_width,
                                              (2.0 * v - 1.0) * lens->view.half_height, 1.0});
            u = pixel ? (pixel->u + 0.5) / lens->camera->width : -1.0;
            v = pixel ? (pixel->v + 0.5) / lens->camera->height : -1.0;
          }
          const bool inside = u >= 0.0 && u < 1.0 && v >= 0.0 && v < 1.0;
          sources_.push_back(inside ? static_cast<std::uint32_t>(v * from_height) * from_width +
                                          static_cast<std::uint32_t>(u * from_width)
                                    : kOutside);
        }
      }
    }
  }

  ColorImage operator()(const ColorImage& image) const {
    constexpr std::uint8_t kUnseen = 128;
    ColorImage small(width_, height_, kUnseen);
    const std::size_t each = std::size_t{samples_} * samples_;
    for (std::size_t pixel = 0; pixel < small.values.size() / 3; ++pixel) {
      std::array<std::uint32_t, 3> sums = {};
      std::uint32_t count = 0;
      for (std::size_t sample = 0; sample < each; ++sample) {
        const std::uint32_t source = sources_[pixel * each + sample];
        if (source == kOutside) continue;
        ++count;
        for (std::size_t c = 0; c < 3; ++c) sums[c] += image.values[3 * std::size_t{source} + c];
      }
      for (std::size_t c = 0; c < 3 && count > 0; ++c) {
        small.values[3 * pixel + c] = static_cast<std::uint8_t>((sums[c] + count / 2) / count);
      }
    }
    return small;
  }

 private:
  static constexpr std::uint32_t kMostSamples = 4;
  static constexpr std::uint32_t kOutside = std::numeric_limits<std::uint32_t>::max();

  std::uint32_t width_;
  std::uint32_t height_ = 0;
  std::uint32_t samples_;               // of a pixel, along each side
  std::vector<std::uint32_t> sources_;  // pixels of the large image, samples_ * samples_ for each
};

// What is common to all images of one camera and size is computed once.
class Shrinkings {
 public:
  Shrinkings(const LandmarkMap& map, std::uint32_t most_width)
      : map_(map), frustum_(detail::frustum_of(map)), most_width_(most_width) {}

  const Shrinking& of(std::size_t frame, const ColorImage& image) {
    const auto camera = frame < map_.frames().cameras.size() ? map_.frames().cameras[frame]
                                                             : std::optional<CameraIndex>();
    const auto key =
        std::tuple(camera ? camera->value + std::size_t{1} : 0, image.width, image.height);
    const auto found = known_.find(key);
    if (found != known_.end()) return found->second;
    std::optional<Shrinking::Lens> lens;
    if (camera && frustum_) lens = {&map_.cameras()[camera->value], *frustum_};
    return known_.emplace(key, Shrinking(lens, image.width, image.height, most_width_))
        .first->second;
  }

 private:
  const LandmarkMap& map_;
  std::optional<Frustum> frustum_;
  std::uint32_t most_width_;
  std::map<std::tuple<std::size_t, std::uint32_t, std::uint32_t>, Shrinking> known_;
};

FrameImage frame_image(std::size_t frame, const ColorImage& color, Shrinkings& shrinkings) {
  constexpr int kQuality = 80;  // of the JPEG, 0 to 100
  const std::string jpeg = jpeg_bytes(shrinkings.of(frame, color)(color), kQuality);
  return {frame, ImageType::kJpeg, {jpeg.begin(), jpeg.end()}};
}

// The images of one map of a network.
class KeyframeImages {
 public:
  KeyframeImages(const LandmarkMap& map, const ImageFolder& folder)
      : map_(map), folder_(folder), shrinkings_(map, kWidestFrameImage), seen_(map.frame_count()) {
    for (const SeenFrame& one : folder.seen(map)) seen_[one.frame] = one;
  }

  const LandmarkMap& map() const { return map_; }
  const ImageFolder& folder() const { return folder_; }
  bool has(FrameIndex frame) const { return seen_[frame.value].has_value(); }
  std::size_t missing() const {
    return static_cast<std::size_t>(std::count(seen_.begin(), seen_.end(), std::nullopt));
  }
  bool has_any() const { return missing() < seen_.size(); }

  FrameImage read(std::size_t frame) {
    return frame_image(frame, folder_.read(map_, *seen_[frame]), shrinkings_);
  }

  struct Places {
    BatchTree tree;
    double squared_gap;  // the median between neighbours
  };
  // Of the landmarks, two at least. Made once.
  const Places& places(const Executor& executor) const {
    if (places_) return *places_;
    const std::vector<Eigen::Vector3d>& positions = map_.landmarks().positions;
    BatchTree tree(positions);
    std::vector<double> gaps(positions.size());
    tree.batch(2).for_each(positions, executor, [&](std::size_t i, const auto& nearest) {
      gaps[i] = nearest.squared_distance(1);
    });
    return places_.emplace(Places{std::move(tree), upper_median(gaps)});
  }

  std::map<std::size_t, FrameImage> shown;  // by frame

 private:
  const LandmarkMap& map_;
  const ImageFolder& folder_;
  Shrinkings shrinkings_;
  std::vector<std::optional<SeenFrame>> seen_;  // by frame
  mutable std::optional<Places> places_;
};

// Landmarks of the target and the source that a pose brings nearer than the target's landmarks are to each other, by
// the median; one to one.
std::vector<std::pair<LandmarkIndex, LandmarkIndex>> matches_at(const KeyframeImages& target,
                                                                const LandmarkMap& source,
                                                                const Similarity3& pose,
                                                                const Executor& executor) {
  const std::vector<Eigen::Vector3d>& places = target.map().landmarks().positions;
  if (places.size() < 2) return {};
  const auto& [tree, squared_gap] = target.places(executor);
  const std::vector<Eigen::Vector3d> moved = moved_points(source.landmarks().positions, pose);
  std::vector<Neighbor> found(moved.size());
  tree.batch(1).for_each(moved, executor, [&](std::size_t i, const auto& nearest) {
    found[i] = {nearest.index(0), nearest.squared_distance(0)};
  });
  constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();
  std::vector<std::uint32_t> nearest(places.size(),
                                     kNone);  // source landmark of each of the target
  std::vector<double> least(places.size(), squared_gap);
  for (std::uint32_t i = 0; i < found.size(); ++i) {
    const auto& [at, squared_distance] = found[i];
    if (squared_distance >= least[at]) continue;
    least[at] = squared_distance;
    nearest[at] = i;
  }
  std::vector<std::pair<LandmarkIndex, LandmarkIndex>> matches;
  for (std::uint32_t i = 0; i < nearest.size(); ++i) {
    if (nearest[i] != kNone) matches.emplace_back(LandmarkIndex{i}, LandmarkIndex{nearest[i]});
  }
  return matches;
}

// The keyframes with images that see the most matches; the first of several.
std::optional<LinkView> best_view(const KeyframeImages& target, const KeyframeImages& source,
                                  const Similarity3& pose, const Executor& executor) {
  if (!target.map().has_observations() || !source.map().has_observations()) return std::nullopt;
  if (target.map().frame_count() == 0 || source.map().frame_count() == 0) return std::nullopt;
  std::vector<std::vector<LandmarkIndex>> matched(target.map().frame_count());  // of the source
  for (const auto& [there, here] : matches_at(target, source.map(), pose, executor)) {
    for (const FrameIndex frame : target.map().observing_frames(there)) {
      if (target.has(frame)) matched[frame.value].push_back(here);
    }
  }
  LinkView best;
  std::vector<std::size_t> counts(source.map().frame_count());
  for (std::size_t i = 0; i < matched.size(); ++i) {
    if (matched[i].size() <= best.matches) continue;
    std::fill(counts.begin(), counts.end(), 0);
    for (const LandmarkIndex landmark : matched[i]) {
      for (const FrameIndex frame : source.map().observing_frames(landmark)) {
        if (source.has(frame)) ++counts[frame.value];
      }
    }
    const auto most = std::max_element(counts.begin(), counts.end());
    if (*most > best.matches) {
      best = {i, static_cast<std::size_t>(most - counts.begin()), *most};
    }
  }
  return best.matches > 0 ? std::optional(best) : std::nullopt;
}

// Links with a pose first: contradicted ones, then from the least probable on, then the stated ones. Then those without a
// pose, from the most probable on.
std::vector<std::size_t> least_certain_first(std::span<const NetworkEdge> edges) {
  std::vector<std::size_t> order(edges.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  const auto rank = [&](std::size_t index) {
    const NetworkEdge& edge = edges[index];
    if (!edge.target_from_source) return 4.0 - edge.probability.value_or(0.0);
    return edge.use == LinkUse::kContradicted ? -1.0 : edge.probability.value_or(2.0);
  };
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return rank(a) < rank(b); });
  return order;
}

// The pose of a link, or else of its maps if they are in one frame.
std::optional<Similarity3> pose_of(const NetworkEdge& edge, const Network& network) {
  if (edge.target_from_source) return edge.target_from_source;
  const NetworkNode& target = network.nodes[edge.target];
  const NetworkNode& source = network.nodes[edge.source];
  if (!target.group || target.group != source.group) return std::nullopt;
  return target.group_from_node.back().inverse() * source.group_from_node.back();
}

// What becomes of a link, and how the page says so.
enum class Outcome { kShown, kNoPose, kNoView, kUnreadable, kBeyondLimit };
constexpr std::array kOutcomeTexts = {
    "", "without a pose", "without two keyframes that have images and see the same landmarks",
    "with an image that cannot be read", "beyond the page's limit of 8 MB"};
static_assert(kMostLinkImageBytes == std::size_t{8} << 20U, "the text says so");

}  // namespace

std::vector<FrameImage> frame_images(const LandmarkMap& map, const std::filesystem::path& folder,
                                     const LogSink& log) {
  const ImageFolder images_of(folder, log);
  const auto seen = images_of.seen(map);
  if (seen.empty()) images_of.refuse(map);
  Shrinkings shrinkings(map, kWidestFrameImage);
  std::vector<FrameImage> images;
  for (const SeenFrame& one : spread(seen, kMostFrameImages)) {
    images.push_back(frame_image(one.frame, images_of.read(map, one), shrinkings));
  }
  return images;
}

// Chooses the images of links as long as they fit on the page.
class LinkImages::Maps {
 public:
  Maps(std::span<const LandmarkMap* const> maps, std::span<const std::filesystem::path> folders,
       const LogSink& log)
      : maps_(maps.size()) {
    std::set<const ImageFolder*> used;
    for (std::size_t i = 0; i < maps.size(); ++i) {
      if (maps[i] == nullptr) continue;
      const ImageFolder& folder = folders_.try_emplace(folders[i], folders[i], log).first->second;
      maps_[i].emplace(*maps[i], folder);
      if (maps_[i]->has_any()) used.insert(&folder);
    }
    for (const auto& map : maps_) {
      if (!map || map->map().frame_count() == 0 || used.contains(&map->folder())) continue;
      map->folder().refuse(map->map());
    }
  }

  std::size_t count() const { return maps_.size(); }

  // Sets the view of the link with that index.
  Outcome show(const NetworkEdge& edge, std::size_t index, Network& network,
               const Execution& execution) {
    const auto pose = pose_of(edge, network);
    if (!pose) return Outcome::kNoPose;
    if (is_full_) return Outcome::kBeyondLimit;
    if (!maps_[edge.target] || !maps_[edge.source]) return Outcome::kNoView;
    KeyframeImages& target = *maps_[edge.target];
    KeyframeImages& source = *maps_[edge.source];
    const auto view = best_view(target, source, *pose, execution.executor);
    if (!view) return Outcome::kNoView;
    const std::pair<KeyframeImages*, std::size_t> sides[] = {{&target, view->target_frame},
                                                             {&source, view->source_frame}};
    std::vector<std::pair<KeyframeImages*, FrameImage>> added;
    std::size_t bytes = bytes_;
    try {
      for (const auto& [map, frame] : sides) {
        if (map->shown.contains(frame)) continue;
        bytes += added.emplace_back(map, map->read(frame)).second.bytes.size();
      }
    } catch (const Error& error) {
      if (error.kind() != ErrorKind::kInput) throw;
      if (execution.log) execution.log(std::string_view(error.what()));
      return Outcome::kUnreadable;
    }
    is_full_ = bytes > kMostLinkImageBytes;
    if (is_full_) return Outcome::kBeyondLimit;
    bytes_ = bytes;
    for (auto& [map, image] : added) map->shown.emplace(image.frame, std::move(image));
    network.links[index].view = view;
    return Outcome::kShown;
  }

  // The shown images of a map, in the order of its frames.
  std::vector<FrameImage> images(std::size_t map) const {
    std::vector<FrameImage> images;
    if (maps_[map]) {
      for (const auto& [frame, image] : maps_[map]->shown) images.push_back(image);
    }
    return images;
  }

  // "3 of 240 keyframes have no image."; empty if all have one.
  std::string missing_text() const {
    std::size_t keyframes = 0;
    std::size_t missing = 0;
    for (const auto& map : maps_) {
      if (!map) continue;
      keyframes += map->map().frame_count();
      missing += map->missing();
    }
    return missing == 0 ? ""
                        : fmt::format(" {} of {} keyframes have no image.", missing, keyframes);
  }

 private:
  std::map<std::filesystem::path, ImageFolder> folders_;
  std::vector<std::optional<KeyframeImages>> maps_;
  std::size_t bytes_ = 0;
  bool is_full_ = false;
};

LinkImages::LinkImages(std::span<const LandmarkMap* const> maps,
                       std::span<const std::filesystem::path> folders, const LogSink& log) {
  refuse_if(folders.size() != maps.size(), "LinkImages", fmt::format("{} folders", folders.size()),
            fmt::format("{}, one for each map", maps.size()));
  maps_ = std::make_unique<Maps>(maps, folders, log);
}

LinkImages::~LinkImages() = default;

void LinkImages::add_to(Report& report, std::span<const NetworkEdge> edges,
                        const Execution& execution) {
  const auto section = std::find_if(report.sections.begin(), report.sections.end(),
                                    [](const Section& one) { return one.id == "network"; });
  auto* const network =
      section == report.sections.end() ? nullptr : std::get_if<Network>(&section->content);
  refuse_if(network == nullptr || network->nodes.size() != maps_->count() ||
                network->links.size() != edges.size(),
            "LinkImages", "the report has no network of these maps and edges",
            "add_network() before");
  std::array<std::size_t, kOutcomeTexts.size()> counts = {};
  for (const std::size_t index : least_certain_first(edges)) {
    const Outcome outcome = maps_->show(edges[index], index, *network, execution);
    ++counts[static_cast<std::size_t>(outcome)];
  }
  for (std::size_t i = 0; i < maps_->count(); ++i) {
    for (Map& map : report.maps) {
      if (map.id == network->nodes[i].map && map.frames) map.frames->images = maps_->images(i);
    }
  }
  std::vector<std::string> others;
  for (std::size_t i = 1; i < counts.size(); ++i) {
    if (counts[i] > 0) others.push_back(fmt::format("{} {}", counts[i], kOutcomeTexts[i]));
  }
  std::string text = section->text ? *section->text + " " : std::string();
  text += fmt::format("{} of {} links show the images of two keyframes", counts[0], edges.size());
  if (!others.empty()) text += fmt::format("; the others: {}", fmt::join(others, ", "));
  section->text = text + "." + maps_->missing_text();
}

}  // namespace cairn::report
