// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/foreign/ros2_recording.hpp"

#include <algorithm>
#include <array>
#include <span>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cairn/core/error.hpp"
#include "cairn/formats/detail/bytes/mcap_file.hpp"
#include "cairn/formats/detail/bytes/scalars.hpp"

namespace cairn {
namespace {

constexpr std::string_view kImage = "sensor_msgs/msg/Image";
constexpr std::string_view kCompressedImage = "sensor_msgs/msg/CompressedImage";
constexpr std::string_view kCameraInfo = "sensor_msgs/msg/CameraInfo";
constexpr std::string_view kPoseStamped = "geometry_msgs/msg/PoseStamped";

// As ROS 2's interface files state the fields.
constexpr std::string_view kHeaderPart =
    "MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n";
constexpr std::string_view kTimePart = "MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n";

struct Definition {
  std::string_view type;
  std::vector<std::string_view> parts;  // its fields, and the types in them
};

const Definition kDefinitions[] = {
    {kImage,
     {"std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\n"
      "uint32 step\nuint8[] data\n",
      kHeaderPart, kTimePart}},
    {kCompressedImage,
     {"std_msgs/Header header\nstring format\nuint8[] data\n", kHeaderPart, kTimePart}},
    {kCameraInfo,
     {"std_msgs/Header header\nuint32 height\nuint32 width\nstring distortion_model\nfloat64[] d\n"
      "float64[9] k\nfloat64[9] r\nfloat64[12] p\nuint32 binning_x\nuint32 binning_y\n"
      "sensor_msgs/RegionOfInterest roi\n",
      "MSG: sensor_msgs/RegionOfInterest\nuint32 x_offset\nuint32 y_offset\nuint32 height\n"
      "uint32 width\nbool do_rectify\n",
      kHeaderPart, kTimePart}},
    {kPoseStamped,
     {"std_msgs/Header header\ngeometry_msgs/Pose pose\n",
      "MSG: geometry_msgs/Pose\ngeometry_msgs/Point position\ngeometry_msgs/Quaternion "
      "orientation\n",
      "MSG: geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat64 z\n",
      "MSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n", kHeaderPart,
      kTimePart}}};

// Little-endian CDR: numbers are aligned to their size, texts end with a zero.
class CdrMessage {
 public:
  explicit CdrMessage(const Ros2RecordingWriter::Stamp& stamp) {
    constexpr std::uint64_t kSecond = 1'000'000'000;
    number(static_cast<std::uint32_t>(stamp.time_ns / kSecond));
    number(static_cast<std::uint32_t>(stamp.time_ns % kSecond));
    text(stamp.frame);
  }
  template <class Number>
  CdrMessage& number(Number value) {
    bytes_.resize(kHead + (bytes_.size() - kHead + sizeof value - 1) / sizeof value * sizeof value);
    detail::append_scalar(bytes_, value);
    return *this;
  }
  CdrMessage& text(std::string_view value) { return data(std::string(value) + '\0'); }
  CdrMessage& data(std::string_view value) {
    number(static_cast<std::uint32_t>(value.size()));
    bytes_ += value;
    return *this;
  }
  CdrMessage& numbers(std::span<const double> values) {
    for (const double value : values) number(value);
    return *this;
  }
  const std::string& bytes() const { return bytes_; }

 private:
  static constexpr std::size_t kHead = 4;
  std::string bytes_ = std::string("\0\1\0\0", kHead);
};

}  // namespace

Ros2RecordingWriter::Ros2RecordingWriter(ByteSink sink)
    : file_(std::make_unique<detail::McapWriter>(std::move(sink))) {}

Ros2RecordingWriter::~Ros2RecordingWriter() = default;

void Ros2RecordingWriter::add(const std::string& topic, const std::string& type,
                              std::uint64_t time_ns, std::string_view data) {
  if (!schemas_.contains(type)) {
    const auto* const known = std::ranges::find(kDefinitions, type, &Definition::type);
    const std::string rule = std::string(80, '=') + "\n";
    schemas_[type] =
        file_->add_schema(type, "ros2msg", fmt::format("{}", fmt::join(known->parts, rule)));
  }
  const auto [channel, is_new] = channels_.try_emplace(topic);
  if (is_new) channel->second = file_->add_channel(schemas_[type], topic, "cdr");
  file_->add_message(channel->second, time_ns, data);
}

void Ros2RecordingWriter::add_camera(const std::string& topic, const Stamp& stamp,
                                     const CameraCalibration& calibration) {
  CdrMessage message(stamp);
  message.number(calibration.height)
      .number(calibration.width)
      .text(calibration.distortion_model)
      .number(static_cast<std::uint32_t>(calibration.distortion.size()))
      .numbers(calibration.distortion)
      .numbers(calibration.intrinsics)
      .numbers(calibration.rectification)
      .numbers(calibration.projection);
  for (int i = 0; i < 6; ++i) message.number(std::uint32_t{0});  // binning and region: all
  add(topic, std::string(kCameraInfo), stamp.time_ns, message.number(std::uint8_t{0}).bytes());
}

void Ros2RecordingWriter::add_image(const std::string& topic, const Stamp& stamp,
                                    std::uint32_t width, std::uint32_t height,
                                    std::string_view encoding, std::string_view data) {
  CdrMessage message(stamp);
  message.number(height)
      .number(width)
      .text(encoding)
      .number(std::uint8_t{0})
      .number(static_cast<std::uint32_t>(data.size() / height))
      .data(data);
  add(topic, std::string(kImage), stamp.time_ns, message.bytes());
}

void Ros2RecordingWriter::add_jpeg(const std::string& topic, const Stamp& stamp,
                                   std::string_view data) {
  add(topic, std::string(kCompressedImage), stamp.time_ns,
      CdrMessage(stamp).text("jpeg").data(data).bytes());
}

void Ros2RecordingWriter::add_pose(const std::string& topic, const Stamp& stamp,
                                   const Rigid3& pose) {
  const Eigen::Vector3d& t = pose.translation();
  const Eigen::Quaterniond q = pose.quaternion();
  add(topic, std::string(kPoseStamped), stamp.time_ns,
      CdrMessage(stamp)
          .numbers(std::array{t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()})
          .bytes());
}

void Ros2RecordingWriter::finish() {
  file_->finish();
}

CameraCalibration ros_calibration(const Camera& camera, double baseline_m) {
  constexpr std::pair<std::string_view, std::string_view> kModels[] = {
      {"PINHOLE", "plumb_bob"},
      {"OPENCV", "plumb_bob"},
      {"FULL_OPENCV", "rational_polynomial"},
      {"OPENCV_FISHEYE", "equidistant"}};
  const auto* const known = std::ranges::find(
      kModels, camera.model, &std::pair<std::string_view, std::string_view>::first);
  refuse_if(known == std::end(kModels), "camera",
            printable(camera.model) + " in a recording of ROS",
            "PINHOLE, OPENCV, FULL_OPENCV or OPENCV_FISHEYE");
  const std::vector<double>& p = camera.parameters;
  CameraCalibration stated;
  stated.width = camera.width;
  stated.height = camera.height;
  stated.distortion_model = known->second;
  stated.distortion.assign(p.begin() + 4, p.end());
  if (known->second == "plumb_bob") stated.distortion.resize(5);
  stated.intrinsics = {p[0], 0, p[2], 0, p[1], p[3], 0, 0, 1};
  stated.projection = {p[0], 0, p[2], -p[0] * baseline_m, 0, p[1], p[3], 0, 0, 0, 1, 0};
  return stated;
}

}  // namespace cairn
