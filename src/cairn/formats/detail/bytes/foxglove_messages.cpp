// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/detail/bytes/foxglove_messages.hpp"

#include <array>

#include "cairn/formats/detail/bytes/protobuf.hpp"

namespace cairn::detail {
namespace {

// Types of fields, by their numbers in descriptor.proto.
enum FieldType : std::uint8_t {
  kDouble = 1,
  kInt64 = 3,
  kInt32 = 5,
  kFixed32 = 7,
  kBool = 8,
  kString = 9,
  kMessageType = 11,
  kBytes = 12,
  kEnum = 14,
};

struct FieldRow {
  std::string_view name;
  std::uint32_t number;
  FieldType type;
  std::string_view of = {};  // name of the message or enum type
  bool repeated = false;
};
constexpr bool kRepeated = true;

struct EnumRow {
  std::string_view name;
  std::vector<std::string_view> values;  // numbered from 0
};

struct MessageRow {
  std::string_view name;
  std::vector<FieldRow> fields;
  std::vector<EnumRow> enums = {};
};

constexpr std::string_view kTime = ".google.protobuf.Timestamp";

std::vector<MessageRow> message_rows() {
  return {
      {"Vector3", {{"x", 1, kDouble}, {"y", 2, kDouble}, {"z", 3, kDouble}}},
      {"Point3", {{"x", 1, kDouble}, {"y", 2, kDouble}, {"z", 3, kDouble}}},
      {"Quaternion", {{"x", 1, kDouble}, {"y", 2, kDouble}, {"z", 3, kDouble}, {"w", 4, kDouble}}},
      {"Color", {{"r", 1, kDouble}, {"g", 2, kDouble}, {"b", 3, kDouble}, {"a", 4, kDouble}}},
      {"Pose",
       {{"position", 1, kMessageType, ".foxglove.Vector3"},
        {"orientation", 2, kMessageType, ".foxglove.Quaternion"}}},
      {"KeyValuePair", {{"key", 1, kString}, {"value", 2, kString}}},
      {"PackedElementField",
       {{"name", 1, kString},
        {"offset", 2, kFixed32},
        {"type", 3, kEnum, ".foxglove.PackedElementField.NumericType"}},
       {{"NumericType",
         {"UNKNOWN", "UINT8", "INT8", "UINT16", "INT16", "UINT32", "INT32", "FLOAT32",
          "FLOAT64"}}}},
      {"PointCloud",
       {{"timestamp", 1, kMessageType, kTime},
        {"frame_id", 2, kString},
        {"pose", 3, kMessageType, ".foxglove.Pose"},
        {"point_stride", 4, kFixed32},
        {"fields", 5, kMessageType, ".foxglove.PackedElementField", kRepeated},
        {"data", 6, kBytes}}},
      {"FrameTransform",
       {{"timestamp", 1, kMessageType, kTime},
        {"parent_frame_id", 2, kString},
        {"child_frame_id", 3, kString},
        {"translation", 4, kMessageType, ".foxglove.Vector3"},
        {"rotation", 5, kMessageType, ".foxglove.Quaternion"}}},
      {"LinePrimitive",
       {{"type", 1, kEnum, ".foxglove.LinePrimitive.Type"},
        {"pose", 2, kMessageType, ".foxglove.Pose"},
        {"thickness", 3, kDouble},
        {"scale_invariant", 4, kBool},
        {"points", 5, kMessageType, ".foxglove.Point3", kRepeated},
        {"color", 6, kMessageType, ".foxglove.Color"},
        {"indices", 8, kFixed32, {}, kRepeated}},
       {{"Type", {"LINE_STRIP", "LINE_LOOP", "LINE_LIST"}}}},
      {"TextPrimitive",
       {{"pose", 1, kMessageType, ".foxglove.Pose"},
        {"billboard", 2, kBool},
        {"font_size", 3, kDouble},
        {"scale_invariant", 4, kBool},
        {"color", 5, kMessageType, ".foxglove.Color"},
        {"text", 6, kString}}},
      {"SceneEntity",
       {{"timestamp", 1, kMessageType, kTime},
        {"frame_id", 2, kString},
        {"id", 3, kString},
        {"frame_locked", 5, kBool},
        {"metadata", 6, kMessageType, ".foxglove.KeyValuePair", kRepeated},
        {"lines", 11, kMessageType, ".foxglove.LinePrimitive", kRepeated},
        {"texts", 13, kMessageType, ".foxglove.TextPrimitive", kRepeated}}},
      {"SceneUpdate", {{"entities", 2, kMessageType, ".foxglove.SceneEntity", kRepeated}}},
  };
}

// DescriptorProto.
ProtobufMessage descriptor(const MessageRow& row) {
  constexpr std::uint32_t kOptionalLabel = 1;
  constexpr std::uint32_t kRepeatedLabel = 3;
  ProtobufMessage message;
  message.text(1, row.name);
  for (const FieldRow& field : row.fields) {
    ProtobufMessage one;
    one.text(1, field.name)
        .whole(3, field.number)
        .whole(4, field.repeated ? kRepeatedLabel : kOptionalLabel)
        .whole(5, field.type);
    if (!field.of.empty()) one.text(6, field.of);
    message.message(2, one);
  }
  for (const EnumRow& type : row.enums) {
    ProtobufMessage one;
    one.text(1, type.name);
    for (std::size_t i = 0; i < type.values.size(); ++i) {
      one.message(2, ProtobufMessage().text(1, type.values[i]).whole(2, i));
    }
    message.message(4, one);
  }
  return message;
}

ProtobufMessage time_message(std::uint64_t time_ns) {
  constexpr std::uint64_t kNanoseconds = 1'000'000'000;
  return ProtobufMessage().whole(1, time_ns / kNanoseconds).whole(2, time_ns % kNanoseconds);
}

// A Vector3 or a Point3.
ProtobufMessage vector_message(const Eigen::Vector3d& x) {
  return ProtobufMessage().real(1, x.x()).real(2, x.y()).real(3, x.z());
}

ProtobufMessage quaternion_message(const Eigen::Quaterniond& q) {
  return ProtobufMessage().real(1, q.x()).real(2, q.y()).real(3, q.z()).real(4, q.w());
}

ProtobufMessage pose_message(const Rigid3& pose) {
  return ProtobufMessage()
      .message(1, vector_message(pose.translation()))
      .message(2, quaternion_message(pose.quaternion()));
}

ProtobufMessage color_message(const SceneColor& color) {
  return ProtobufMessage().real(1, color.r).real(2, color.g).real(3, color.b).real(4, color.a);
}

ProtobufMessage line_message(const SceneLine& line) {
  ProtobufMessage message;
  message.whole(1, static_cast<std::uint8_t>(line.type))
      .message(2, pose_message({}))
      .real(3, line.thickness_px)
      .whole(4, 1);  // the thickness is in pixels
  for (const Eigen::Vector3d& point : line.points) message.message(5, vector_message(point));
  message.message(6, color_message(line.color));
  if (!line.indices.empty()) message.fixed32s(8, line.indices);
  return message;
}

ProtobufMessage text_message(const SceneText& text) {
  constexpr double kFontPixels = 14.0;
  return ProtobufMessage()
      .message(1, pose_message(Rigid3(Eigen::Quaterniond::Identity(), text.position)))
      .whole(2, 1)  // faces the viewer
      .real(3, kFontPixels)
      .whole(4, 1)  // the font's size is in pixels
      .message(5, color_message({}))
      .text(6, text.text);
}

// NumericType of each ScalarType; 0 for a type that it lacks.
constexpr std::array<std::uint32_t, kScalars.size()> kNumericTypes = {2, 1, 4, 3, 6, 5, 0, 0, 7, 8};

}  // namespace

std::string foxglove_descriptors() {
  ProtobufMessage time;
  time.text(1, "google/protobuf/timestamp.proto").text(2, "google.protobuf");
  time.message(4, descriptor({"Timestamp", {{"seconds", 1, kInt64}, {"nanos", 2, kInt32}}}));
  time.text(12, "proto3");

  ProtobufMessage foxglove;
  foxglove.text(1, "foxglove.proto").text(2, "foxglove").text(3, "google/protobuf/timestamp.proto");
  for (const MessageRow& row : message_rows()) foxglove.message(4, descriptor(row));
  foxglove.text(12, "proto3");

  return ProtobufMessage().message(1, time).message(1, foxglove).bytes();
}

std::string point_cloud_message(std::uint64_t time_ns, std::string_view frame,
                                std::span<const PointField> fields, std::string_view data) {
  ProtobufMessage message;
  message.message(1, time_message(time_ns)).text(2, frame).message(3, pose_message({}));
  std::size_t stride = 0;
  ProtobufMessage places;
  for (const PointField& field : fields) {
    places.message(5, ProtobufMessage()
                          .text(1, field.name)
                          .fixed32(2, static_cast<std::uint32_t>(stride))
                          .whole(3, kNumericTypes[static_cast<std::size_t>(field.type)]));
    stride += size_of(field.type);
  }
  message.fixed32(4, static_cast<std::uint32_t>(stride));
  return message.bytes() + places.bytes() + ProtobufMessage().bytes(6, data).bytes();
}

std::string frame_transform_message(std::uint64_t time_ns, std::string_view parent,
                                    std::string_view child, const Rigid3& parent_from_child) {
  return ProtobufMessage()
      .message(1, time_message(time_ns))
      .text(2, parent)
      .text(3, child)
      .message(4, vector_message(parent_from_child.translation()))
      .message(5, quaternion_message(parent_from_child.quaternion()))
      .bytes();
}

std::string scene_update_message(std::uint64_t time_ns, std::string_view frame,
                                 std::span<const SceneEntity> entities) {
  ProtobufMessage update;
  for (const SceneEntity& entity : entities) {
    ProtobufMessage message;
    message.message(1, time_message(time_ns)).text(2, frame).text(3, entity.id);
    message.whole(5, 1);  // moves with its frame
    for (const auto& [key, value] : entity.metadata) {
      message.message(6, ProtobufMessage().text(1, key).text(2, value));
    }
    for (const SceneLine& line : entity.lines) message.message(11, line_message(line));
    for (const SceneText& text : entity.texts) message.message(13, text_message(text));
    update.message(2, message);
  }
  return update.bytes();
}

}  // namespace cairn::detail
