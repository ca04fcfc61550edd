// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/map/common_images.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <string_view>
#include <tuple>
#include <unordered_map>

#include <Eigen/Core>

namespace cairn {
namespace {

using KnownImage = MapImages::Image;
using Keypoint = MapImages::Keypoint;

constexpr double kWithin = 0.5;    // pixels
constexpr double kExactly = 1e-3;  // pixels; formats write so many digits at least
// Keypoints at exactly one pixel, which chance does not bring about, unless pixels are whole or half.
constexpr std::size_t kFewestExact = 4;
// Of the observations of the image that has fewer. Each map observes keypoints of its own choice; those of two images
// coincide for a few in a hundred.
constexpr double kLeastShared = 0.1;
constexpr std::size_t kFewestShared = 3;
constexpr double kLeastSharedByContent = 0.25;
constexpr double kLeastSharedWithoutName = 0.9;
constexpr std::size_t kFewestSharedByContent = 20;
constexpr double kLeastSharedAtOneTime = 0.5;
constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();

std::string_view base_name(std::string_view name) {
  return name.substr(name.find_last_of("/\\") + 1);
}

// Index of the image with each base name; kNone for names that several have.
std::map<std::string_view, std::size_t> by_base_name(const std::vector<KnownImage>& images) {
  std::map<std::string_view, std::size_t> result;
  for (std::size_t i = 0; i < images.size(); ++i) {
    if (images[i].name.empty()) continue;
    const auto [at, is_new] = result.emplace(base_name(images[i].name), i);
    if (!is_new) at->second = kNone;
  }
  return result;
}

// Pairs of keypoints within a distance, the nearest for each, one to one.
std::vector<std::pair<const Keypoint*, const Keypoint*>> coinciding(const KnownImage& a,
                                                                    const KnownImage& b,
                                                                    double within) {
  std::vector<std::tuple<double, const Keypoint*, const Keypoint*>> near;
  auto begin = b.keypoints.begin();
  for (const Keypoint& one : a.keypoints) {
    while (begin != b.keypoints.end() && begin->pixel.u < one.pixel.u - within) ++begin;
    for (auto other = begin; other != b.keypoints.end() && other->pixel.u <= one.pixel.u + within;
         ++other) {
      const double apart = std::hypot(other->pixel.u - one.pixel.u, other->pixel.v - one.pixel.v);
      if (apart <= within) near.emplace_back(apart, &one, &*other);
    }
  }
  std::sort(near.begin(), near.end());
  std::vector<std::pair<const Keypoint*, const Keypoint*>> result;
  std::vector<char> taken_a(a.keypoints.size(), 0);
  std::vector<char> taken_b(b.keypoints.size(), 0);
  for (const auto& [apart, one, other] : near) {
    char& here = taken_a[static_cast<std::size_t>(one - a.keypoints.data())];
    char& there = taken_b[static_cast<std::size_t>(other - b.keypoints.data())];
    if (here != 0 || there != 0) continue;
    here = there = 1;
    result.emplace_back(one, other);
  }
  return result;
}

bool is_on_grid(const Pixel& pixel) {
  const auto is_whole = [](double x) { return std::abs(x - std::round(x)) < kExactly; };
  return is_whole(2.0 * pixel.u) && is_whole(2.0 * pixel.v);
}

struct SharedKeypoints {
  std::vector<std::pair<const Keypoint*, const Keypoint*>> pairs;
  bool exact = false;
};

// The keypoints that both images have: those that are the same to the last digits, or else those that are near.
SharedKeypoints shared_keypoints(const KnownImage& a, const KnownImage& b) {
  SharedKeypoints exact{coinciding(a, b, kExactly), true};
  std::erase_if(exact.pairs, [](const auto& pair) { return is_on_grid(pair.first->pixel); });
  if (exact.pairs.size() >= kFewestExact) return exact;
  return {coinciding(a, b, kWithin), false};
}

// Images with timestamps are compared by these.
bool are_timed(const KnownImage& a, const KnownImage& b) {
  return a.timestamp_s && b.timestamp_s;
}

bool is_timed(const KnownImage& image) {
  return image.timestamp_s.has_value();
}

bool may_have_one_size(const KnownImage& a, const KnownImage& b) {
  return a.width == 0 || b.width == 0 || (a.width == b.width && a.height == b.height);
}

// @param shared shared_keypoints() of both
bool have_one_content(const KnownImage& a, const KnownImage& b, const SharedKeypoints& shared) {
  if (!may_have_one_size(a, b)) return false;
  const std::size_t fewer = std::min(a.keypoints.size(), b.keypoints.size());
  const std::size_t count = shared.pairs.size();
  return shared.exact || (count >= kFewestShared &&
                          static_cast<double>(count) >= kLeastShared * static_cast<double>(fewer));
}

// The vector from a keypoint to the nearest other one that is not within a keypoint's distance.
Eigen::Vector2d step_from(const KnownImage& image, std::size_t from) {
  constexpr double kOwn = 1.5;  // pixels
  Eigen::Vector2d nearest(0.0, 0.0);
  double least = std::numeric_limits<double>::infinity();
  const Pixel& here = image.keypoints[from].pixel;
  for (const auto& [pixel, landmark] : image.keypoints) {
    const Eigen::Vector2d step(pixel.u - here.u, pixel.v - here.v);
    const double length = step.norm();
    if (length <= kOwn || length >= least) continue;
    least = length;
    nearest = step;
  }
  return nearest;
}

// Whether the keypoints coincide about as often if one image is shifted by steps between its own keypoints. Keypoints on
// a common grid, such as those of dense matchers, do so whatever the images show.
bool is_by_grid(const KnownImage& a, const KnownImage& b, const SharedKeypoints& shared) {
  constexpr std::size_t kSteps = 8;
  constexpr std::size_t kClearly = 2;  // times as many
  const auto is_whole = [](const auto& pair) { return is_on_grid(pair.first->pixel); };
  const bool leaves_out_whole = std::ranges::none_of(shared.pairs, is_whole);
  KnownImage shifted = b;
  for (std::size_t k = 0; k < kSteps; ++k) {
    const Eigen::Vector2d step = step_from(b, (2 * k + 1) * b.keypoints.size() / (2 * kSteps));
    if (step.isZero()) continue;
    for (std::size_t i = 0; i < b.keypoints.size(); ++i) {
      const Pixel& pixel = b.keypoints[i].pixel;
      shifted.keypoints[i].pixel = {pixel.u + step.x(), pixel.v + step.y()};
    }
    auto pairs = coinciding(a, shifted, shared.exact ? kExactly : kWithin);
    if (leaves_out_whole) std::erase_if(pairs, is_whole);
    if (kClearly * pairs.size() >= shared.pairs.size()) return true;
  }
  return false;
}

struct PixelHash {
  std::size_t operator()(const std::pair<double, double>& pixel) const {
    const std::hash<double> hash;
    return hash(pixel.first) * 1'000'003U + hash(pixel.second);
  }
};

// Pairs images that are left by their exact pixels. A pixel of several keypoints, such as a placeholder, does not count.
class ByContent {
 public:
  explicit ByContent(const std::vector<KnownImage>& images)
      : images_(images), counts_(images.size(), 0) {}

  void add(std::size_t image) {
    const std::vector<Key> keys = keys_of(images_[image]);
    for (const Key& key : keys) at_[key].push_back(image);
    counts_[image] = keys.size();
  }

  // The image that shares most pixels, if these are enough.
  std::optional<std::size_t> same_as(const KnownImage& other) const {
    const std::vector<Key> keys = keys_of(other);
    std::map<std::size_t, std::size_t> shared;
    for (const Key& key : keys) {
      const auto found = at_.find(key);
      if (found == at_.end()) continue;
      for (const std::size_t image : found->second) {
        if (!are_timed(images_[image], other)) ++shared[image];
      }
    }
    const auto most =
        std::max_element(shared.begin(), shared.end(),
                         [](const auto& a, const auto& b) { return a.second < b.second; });
    if (most == shared.end() || most->second < kFewestSharedByContent) return std::nullopt;
    const KnownImage& image = images_[most->first];
    const std::size_t fewer = std::min(counts_[most->first], keys.size());
    const bool named = !image.name.empty() && !other.name.empty();
    const bool enough =
        static_cast<double>(most->second) >=
        (named ? kLeastSharedByContent : kLeastSharedWithoutName) * static_cast<double>(fewer);
    if (!enough || !may_have_one_size(image, other)) return std::nullopt;
    return most->first;
  }

 private:
  using Key = std::pair<double, double>;

  // Ascending.
  static std::vector<Key> keys_of(const KnownImage& image) {
    std::vector<Key> all;
    for (const auto& [pixel, landmark] : image.keypoints) {
      all.emplace_back(std::round(pixel.u / kExactly), std::round(pixel.v / kExactly));
    }
    std::sort(all.begin(), all.end());
    std::vector<Key> once;
    for (auto begin = all.begin(); begin != all.end();) {
      const auto end = std::upper_bound(begin, all.end(), *begin);
      if (end - begin == 1) once.push_back(*begin);
      begin = end;
    }
    return once;
  }

  const std::vector<KnownImage>& images_;
  std::vector<std::size_t> counts_;  // keys of each image that was added
  std::unordered_map<Key, std::vector<std::size_t>, PixelHash> at_;
};

// Landmarks that keypoints of the common images show; of contradictory pairs, those that more keypoints show.
std::vector<std::pair<LandmarkIndex, LandmarkIndex>> common_landmarks(
    const std::vector<SharedKeypoints>& of_images) {
  std::map<std::pair<LandmarkIndex, LandmarkIndex>, std::size_t> votes;
  for (const SharedKeypoints& shared : of_images) {
    for (const auto& [one, other] : shared.pairs) ++votes[{one->landmark, other->landmark}];
  }
  std::vector<std::pair<std::size_t, std::pair<LandmarkIndex, LandmarkIndex>>> order;
  for (const auto& [pair, count] : votes) order.emplace_back(count, pair);
  std::stable_sort(order.begin(), order.end(),
                   [](const auto& a, const auto& b) { return a.first > b.first; });
  std::map<LandmarkIndex, LandmarkIndex> first_to_second;
  std::map<LandmarkIndex, LandmarkIndex> second_to_first;
  for (const auto& [count, pair] : order) {
    if (first_to_second.contains(pair.first) || second_to_first.contains(pair.second)) continue;
    first_to_second.emplace(pair.first, pair.second);
    second_to_first.emplace(pair.second, pair.first);
  }
  return {first_to_second.begin(), first_to_second.end()};
}

// Which images of two maps are the same, by one sign after the other; each image is paired once.
class Pairing {
 public:
  Pairing(const std::vector<KnownImage>& first, const std::vector<KnownImage>& second)
      : first_(first), second_(second), partner_(first.size(), kNone), taken_(second.size(), 0) {}

  void by_time() {
    std::multimap<double, std::size_t> at;
    for (std::size_t i = 0; i < second_.size(); ++i) {
      if (is_timed(second_[i])) at.emplace(*second_[i].timestamp_s, i);
    }
    for (std::size_t i = 0; i < first_.size(); ++i) {
      if (!is_timed(first_[i])) continue;
      std::size_t best = kNone;
      SharedKeypoints most;
      const auto [begin, end] = at.equal_range(*first_[i].timestamp_s);
      for (auto one = begin; one != end; ++one) {
        const KnownImage& other = second_[one->second];
        if (taken_[one->second] != 0 || !may_have_one_size(first_[i], other)) continue;
        SharedKeypoints keypoints{coinciding(first_[i], other, kExactly), true};
        const std::size_t fewer = std::min(first_[i].keypoints.size(), other.keypoints.size());
        const std::size_t count = keypoints.pairs.size();
        if (count <= most.pairs.size() || count < kFewestExact ||
            static_cast<double>(count) < kLeastSharedAtOneTime * static_cast<double>(fewer)) {
          continue;
        }
        best = one->second;
        most = std::move(keypoints);
      }
      if (best != kNone) pair(i, best, std::move(most));
    }
  }

  void by_name() {
    std::map<std::string_view, std::size_t> by_name;
    for (std::size_t i = 0; i < second_.size(); ++i) by_name.emplace(second_[i].name, i);
    const auto bases_of_first = by_base_name(first_);
    const auto bases_of_second = by_base_name(second_);
    for (std::size_t i = 0; i < first_.size(); ++i) {
      const KnownImage& image = first_[i];
      if (image.name.empty() || partner_[i] != kNone) continue;
      std::size_t other = kNone;
      if (const auto named = by_name.find(image.name); named != by_name.end()) {
        other = named->second;
      } else if (bases_of_first.at(base_name(image.name)) == i) {
        const auto based = bases_of_second.find(base_name(image.name));
        if (based != bases_of_second.end()) other = based->second;
      }
      if (other == kNone || taken_[other] != 0 || are_timed(image, second_[other])) continue;
      const KnownImage& there = second_[other];
      SharedKeypoints keypoints = shared_keypoints(image, there);
      if (have_one_content(image, there, keypoints)) pair(i, other, std::move(keypoints));
    }
  }

  void by_content() {
    ByContent by_content(second_);
    for (std::size_t i = 0; i < taken_.size(); ++i) {
      if (taken_[i] == 0) by_content.add(i);
    }
    for (std::size_t i = 0; i < first_.size(); ++i) {
      if (partner_[i] != kNone) continue;
      const auto other = by_content.same_as(first_[i]);
      if (!other || taken_[*other] != 0) continue;
      pair(i, *other, shared_keypoints(first_[i], second_[*other]));
    }
  }

  // By the first map's frame.
  std::vector<CommonImages::Frames> same() const {
    std::vector<CommonImages::Frames> frames;
    for (std::size_t i = 0; i < partner_.size(); ++i) {
      if (partner_[i] == kNone) continue;
      frames.emplace_back(first_[i].frame, second_[partner_[i]].frame);
    }
    return frames;
  }

  const std::vector<SharedKeypoints>& shared() const { return shared_; }

 private:
  void pair(std::size_t of_first, std::size_t of_second, SharedKeypoints keypoints) {
    if (is_by_grid(first_[of_first], second_[of_second], keypoints)) return;
    partner_[of_first] = of_second;
    taken_[of_second] = 1;
    shared_.push_back(std::move(keypoints));
  }

  const std::vector<KnownImage>& first_;
  const std::vector<KnownImage>& second_;
  std::vector<std::size_t> partner_;     // by image of the first
  std::vector<char> taken_;              // by image of the second
  std::vector<SharedKeypoints> shared_;  // of the images that are the same
};

}  // namespace

MapImages::MapImages(const LandmarkMap& map) {
  const FrameTable& frames = map.frames();
  std::vector<std::size_t> image_of(map.frame_count(), kNone);
  for (std::uint32_t i = 0; i < map.frame_count(); ++i) {
    image_of[i] = images_.size();
    Image& image = images_.emplace_back(Image{FrameIndex{i}, {}, {}, 0, 0, {}});
    if (!frames.image_names.empty()) image.name = frames.image_names[i];
    if (!frames.timestamps_s.empty()) image.timestamp_s = frames.timestamps_s[i];
    if (frames.cameras.empty() || !frames.cameras[i]) continue;
    const Camera& camera = map.cameras()[frames.cameras[i]->value];
    image.width = camera.width;
    image.height = camera.height;
  }
  const ObservationTable& observations = map.observations();
  if (observations.offsets.empty()) return;
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    for (std::uint64_t k = observations.offsets[i]; k < observations.offsets[i + 1]; ++k) {
      const std::size_t image = image_of[observations.frames[k].value];
      if (image == kNone) continue;
      images_[image].keypoints.push_back({observations.pixels[k], LandmarkIndex{i}});
    }
  }
  for (MapImages::Image& image : images_) {
    std::sort(image.keypoints.begin(), image.keypoints.end(),
              [](const Keypoint& a, const Keypoint& b) {
                return std::tuple(a.pixel.u, a.pixel.v, a.landmark) <
                       std::tuple(b.pixel.u, b.pixel.v, b.landmark);
              });
  }
}

MapImages MapImages::renumbered(const std::vector<std::optional<LandmarkIndex>>& landmarks) && {
  for (Image& image : images_) {
    std::erase_if(image.keypoints,
                  [&](const Keypoint& one) { return !landmarks[one.landmark.value]; });
    for (Keypoint& one : image.keypoints) one.landmark = *landmarks[one.landmark.value];
  }
  return std::move(*this);
}

CommonImages common_images(const MapImages& first, const MapImages& second) {
  CommonImages result;
  if (first.all().empty() || second.all().empty()) return result;
  Pairing pairing(first.all(), second.all());
  pairing.by_time();
  if (!std::all_of(first.all().begin(), first.all().end(), is_timed) ||
      !std::all_of(second.all().begin(), second.all().end(), is_timed)) {
    pairing.by_name();
    pairing.by_content();
  }
  result.same = pairing.same();
  result.landmarks = common_landmarks(pairing.shared());
  return result;
}

}  // namespace cairn
