// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/detail/recorded_images.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <optional>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/recording/messages.hpp"
#include "cairn/recording/recording.hpp"
#include "cairn/recording/topics.hpp"
#include "cairn/vision/detail/depth_registration.hpp"

namespace cairn::detail {

// The images of one topic.
struct RecordedTrack {
  std::uint32_t topic = 0;
  std::vector<ImageEntry> entries;        // in the order of time
  std::vector<RecordedMessage> messages;  // of entries
};

namespace {

// Where blue, green and red are in a pixel of 8-bit channels.
struct PixelLayout {
  std::string_view encoding;
  std::size_t bytes;
  std::size_t blue, green, red;
};
constexpr PixelLayout kPixelLayouts[] = {
    {"mono8", 1, 0, 0, 0}, {"8UC1", 1, 0, 0, 0}, {"mono16", 2, 1, 1, 1},
    {"bgr8", 3, 0, 1, 2},  {"8UC3", 3, 0, 1, 2}, {"rgb8", 3, 2, 1, 0},
    {"bgra8", 4, 0, 1, 2}, {"8UC4", 4, 0, 1, 2}, {"rgba8", 4, 2, 1, 0}};

// Rows of `bytes` a pixel.
void check_rows(const ImageMessage& image, std::size_t bytes, const std::string& name) {
  constexpr std::uint32_t kLargest = 16384;
  reject_if(
      image.width == 0 || image.height == 0 || image.width > kLargest || image.height > kLargest,
      name, fmt::format("an image of {} x {} pixels", image.width, image.height),
      fmt::format("1 to {} pixels a side", kLargest));
  reject_if(image.row_bytes < bytes * image.width ||
                image.data.size() < std::size_t{image.row_bytes} * image.height,
            name,
            fmt::format("{} bytes, in rows of {}, for {} x {} pixels of {}", image.data.size(),
                        image.row_bytes, image.width, image.height, image.encoding),
            "bytes for each pixel");
}

template <class ImageOf>
ImageOf from_pixels(const ImageMessage& message, const std::string& name) {
  const auto* const layout =
      std::find_if(std::begin(kPixelLayouts), std::end(kPixelLayouts),
                   [&](const PixelLayout& known) { return known.encoding == message.encoding; });
  reject_if(layout == std::end(kPixelLayouts), name,
            "an image encoded as " + printable(message.encoding),
            "mono8, mono16, bgr8, rgb8, bgra8, rgba8, or a CompressedImage");
  check_rows(message, layout->bytes, name);
  // Of 16 bits the higher byte.
  const std::size_t shift = layout->bytes == 2 && message.is_big_endian ? 1 : 0;
  ImageOf image(message.width, message.height);
  for (std::uint32_t v = 0; v < image.height; ++v) {
    const auto* pixel = reinterpret_cast<const std::uint8_t*>(message.data.data()) +
                        std::size_t{v} * message.row_bytes;
    for (std::uint32_t u = 0; u < image.width; ++u, pixel += layout->bytes) {
      const std::uint8_t blue = pixel[layout->blue - shift];
      const std::uint8_t green = pixel[layout->green - shift];
      const std::uint8_t red = pixel[layout->red - shift];
      if constexpr (ImageOf::kPixelValues == 1) {
        image.at(u, v) = layout->bytes < 3 ? green : gray_of(blue, green, red);
      } else {
        std::uint8_t* const bgr = &image.at(u, v);
        bgr[0] = blue, bgr[1] = green, bgr[2] = red;
      }
    }
  }
  return image;
}

template <class Number>
Image<Number> numbers_of(const ImageMessage& message, const std::string& name) {
  check_rows(message, sizeof(Number), name);
  Image<Number> image(message.width, message.height);
  for (std::uint32_t v = 0; v < image.height; ++v) {
    std::memcpy(&image.at(0, v), message.data.data() + std::size_t{v} * message.row_bytes,
                image.width * sizeof(Number));
  }
  if (message.is_big_endian) {
    for (Number& value : image.values) {
      auto bytes = std::bit_cast<std::array<char, sizeof(Number)>>(value);
      std::reverse(bytes.begin(), bytes.end());
      value = std::bit_cast<Number>(bytes);
    }
  }
  return image;
}

DepthImage valid_depth(DepthImage depth) {
  for (float& metres : depth.values) {
    if (!std::isfinite(metres) || metres < 0.0F) metres = 0.0F;
  }
  return depth;
}

// A PNG behind a head: of whole numbers, or of A / depth + B for depth in metres.
DepthImage compressed_depth(const ImageMessage& message, const std::string& name,
                            double units_per_metre) {
  struct Head {
    std::int32_t format;
    float a, b;
  } head;
  reject_if(message.encoding.find("rvl") != std::string::npos, name, "depth compressed as RVL",
            "PNG");
  reject_if(message.data.size() < sizeof head, name, "compressed depth without its head",
            "12 bytes and a PNG");
  std::memcpy(&head, message.data.data(), sizeof head);
  const auto stored = decode_image<StoredDepthImage>(message.data.substr(sizeof head), name);
  if (!message.encoding.starts_with("32FC1")) return metric_depth(stored, units_per_metre);
  DepthImage depth(stored.width, stored.height);
  std::transform(stored.values.begin(), stored.values.end(), depth.values.begin(),
                 [&](std::uint16_t value) {
                   return value == 0 ? 0.0F : head.a / (static_cast<float>(value) - head.b);
                 });
  return valid_depth(std::move(depth));
}

RecordedTrack track_of(const Recording& recording, std::uint32_t topic, const LogSink& log) {
  RecordedTrack track{topic, {}, {}};
  const RecordedTopic& its = recording.topics()[topic];
  const std::string name = recording.name() + ": " + its.name;
  // An absolute path would replace that of the recording.
  const std::string file_name = its.name.substr(its.name.starts_with('/') ? 1 : 0);
  std::vector<std::pair<double, RecordedMessage>> stamped;
  for (const RecordedMessage& message : recording.messages()) {
    if (message.topic != topic) continue;
    constexpr std::size_t kStamp = 12;  // bytes, in either encoding
    const std::string bytes = recording.read(message, kStamp);
    stamped.emplace_back(stamp_of({bytes, its.encoding, name}), message);
  }
  std::stable_sort(stamped.begin(), stamped.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  // A map names its images as those of a folder in TUM's layout.
  const std::string first = recording.read(stamped.front().second);
  const bool is_jpeg =
      its.type == "sensor_msgs/CompressedImage" &&
      parse_image({first, its.encoding, name}, its.type).encoding.find("jp") != std::string::npos;
  const char* const ending = is_jpeg ? ".jpg" : ".png";
  for (const auto& [stamp_s, message] : stamped) {
    if (!track.entries.empty() && track.entries.back().timestamp_s == stamp_s) continue;
    track.entries.push_back({stamp_s, fmt::format("{}/{:.6f}{}", file_name, stamp_s, ending)});
    track.messages.push_back(message);
  }
  const std::size_t repeated = stamped.size() - track.entries.size();
  if (repeated > 0 && log) {
    log(fmt::format("{}: {} of {} images have the time of another; left out", name, repeated,
                    stamped.size()));
  }
  return track;
}

}  // namespace

struct RecordedImages::Content {
  Recording recording;
  SensorTopics topics;
  RecordedTrack images = {};
  RecordedTrack partners = {};
  std::optional<DepthRegistration> to_images = {};  // of the depth

  std::string info_place(const ImageTopic& topic) const {
    return fmt::format("{}: CameraInfo of {}", recording.name(),
                       recording.topics()[topic.topic].name);
  }
  const CameraInfo& info_of(const ImageTopic& topic) const {
    reject_if(!topic.info, info_place(topic), "is missing", "one, or the camera given by --camera");
    return *topic.info;
  }
  Camera camera_of_topic(const ImageTopic& topic) const {
    return camera_of(info_of(topic), is_rectified_topic(recording.topics()[topic.topic].name),
                     info_place(topic));
  }
  template <class Use>
  auto with_message(const RecordedTrack& track, std::size_t i, const std::filesystem::path& name,
                    const Use& use) const {
    const RecordedTopic& topic = recording.topics()[track.topic];
    const std::string bytes = recording.read(track.messages.at(i));
    return use(parse_image({bytes, topic.encoding, name.string()}, topic.type));
  }
  template <class ImageOf>
  ImageOf pixels(const RecordedTrack& track, std::size_t i,
                 const std::filesystem::path& name) const {
    return with_message(track, i, name, [&](const ImageMessage& message) {
      return message.is_compressed ? decode_image<ImageOf>(message.data, name)
                                   : from_pixels<ImageOf>(message, name.string());
    });
  }
  // std::nullopt if the depth is of the pixels of the images, as where one camera took both.
  std::optional<DepthRegistration> registration() const {
    const auto& color = topics.image.info;
    const auto& depth = topics.depth_or_right.info;
    if (!color || !depth) return std::nullopt;
    constexpr double kSame = 1.0;  // pixels
    const bool is_same = std::ranges::all_of(std::array{0, 2, 4, 5}, [&](std::size_t at) {
      return std::abs(color->intrinsics[at] - depth->intrinsics[at]) < kSame;
    });
    const auto pose = image_from_partner(recording, topics);
    // Drivers give both cameras of a device the same nominal CameraInfo.
    constexpr double kSamePlace = 1e-3;  // m
    const bool is_beside = pose && pose->translation().norm() > kSamePlace &&
                           topics.image.frame != topics.depth_or_right.frame;
    if (is_same && !is_beside) return std::nullopt;
    reject_if(!pose, info_place(topics.depth_or_right), "another camera than that of the images",
              "depth that is registered to them, as the topic aligned_depth_to_color, or tf_static "
              "that says where it is");
    return DepthRegistration(camera_of_topic(topics.depth_or_right), camera_of_topic(topics.image),
                             *pose);
  }
};

bool RecordedImages::is_at(const std::filesystem::path& path) {
  return Recording::is_at(path);
}

RecordedImages::RecordedImages(const std::filesystem::path& path, const std::string& topics,
                               const LogSink& log) {
  Recording recording(path, log);
  SensorTopics chosen = choose_topics(recording, image_topics(recording), topics);
  Content content{std::move(recording), std::move(chosen)};
  content.images = track_of(content.recording, content.topics.image.topic, log);
  content.partners = track_of(content.recording, content.topics.depth_or_right.topic, log);
  if (!content.topics.is_stereo()) content.to_images = content.registration();
  content_ = std::make_unique<const Content>(std::move(content));
}

RecordedImages::~RecordedImages() = default;

SequenceLists RecordedImages::lists(bool needs_rig) const {
  SequenceLists lists{content_->images.entries, content_->partners.entries, std::nullopt, {}};
  const SensorTopics& topics = content_->topics;
  constexpr double kMillimetre = 0.001;  // of 16 bits, in ROS (REP 118)
  lists.depth_units_per_metre =
      1.0 / depth_unit_m(content_->recording, topics.depth_or_right).value_or(kMillimetre);
  if (!topics.is_stereo()) return lists;
  lists.calibration = content_->info_place(topics.depth_or_right);
  if (!needs_rig) return lists;
  const Camera left = content_->camera_of_topic(topics.image);
  const Camera right = content_->camera_of_topic(topics.depth_or_right);
  const auto pose = image_from_partner(content_->recording, topics);
  reject_if(!pose, content_->recording.name(),
            "neither CameraInfo nor tf_static say where the right camera is",
            "a baseline in P of the right CameraInfo");
  lists.rig = StereoRig{left, right, *pose};
  return lists;
}

Camera RecordedImages::camera() const {
  return content_->camera_of_topic(content_->topics.image);
}

Trajectory RecordedImages::poses(const std::string& topic) const {
  return camera_poses(content_->recording, topic, content_->topics.image.frame);
}

template <class ImageOf>
ImageOf RecordedImages::image(std::size_t i, const std::filesystem::path& name) const {
  return content_->pixels<ImageOf>(content_->images, i, name);
}
template GrayImage RecordedImages::image(std::size_t, const std::filesystem::path&) const;
template ColorImage RecordedImages::image(std::size_t, const std::filesystem::path&) const;

GrayImage RecordedImages::right(std::size_t i, const std::filesystem::path& name) const {
  return content_->pixels<GrayImage>(content_->partners, i, name);
}

DepthImage RecordedImages::depth(std::size_t i, const std::filesystem::path& name,
                                 double units_per_metre) const {
  const auto stored = [&](const ImageMessage& message) {
    if (message.is_compressed) return compressed_depth(message, name.string(), units_per_metre);
    if (message.encoding == "32FC1") return valid_depth(numbers_of<float>(message, name.string()));
    reject_if(message.encoding != "16UC1" && message.encoding != "mono16", name.string(),
              "depth encoded as " + printable(message.encoding), "16UC1 or 32FC1");
    return metric_depth(numbers_of<std::uint16_t>(message, name.string()), units_per_metre);
  };
  DepthImage depth = content_->with_message(content_->partners, i, name, stored);
  if (!content_->to_images) return depth;
  const CameraInfo& camera = *content_->topics.depth_or_right.info;
  reject_if(depth.width != camera.width || depth.height != camera.height, name.string(),
            fmt::format("{} x {} pixels", depth.width, depth.height),
            fmt::format("{} x {}, as its CameraInfo says", camera.width, camera.height));
  return (*content_->to_images)(depth);
}

}  // namespace cairn::detail
