// SPDX-License-Identifier: BSD-3-Clause
#include <string>

#include "cairn/recording/recording.hpp"
#include "cairn/recording/topics.hpp"
#include "cairn/vision/sequence.hpp"

#include "fuzz/file_in_memory.hpp"
#include "fuzz/imported.hpp"

// A recording of ROS in any container, which its first bytes say, and the messages in it.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const std::filesystem::path path =
      cairn::testing::path_in_memory("recording").replace_extension(".db3");
  cairn::testing::write_bytes(path, cairn::testing::text_of(data, size));
  cairn::testing::expect_read_or_refused(
      [&] {
        const cairn::Recording recording(path);
        std::uint64_t last_ns = 0;
        for (const cairn::RecordedMessage& message : recording.messages()) {
          if (message.time_ns < last_ns) cairn::testing::abort_because("times descend");
          last_ns = message.time_ns;
          if (message.topic >= recording.topics().size()) {
            cairn::testing::abort_because("a topic that is not there");
          }
        }
        for (const cairn::PoseTopic& topic : cairn::pose_topics(recording)) {
          cairn::camera_poses(recording, topic.name + ",camera", "camera");
        }
      },
      path.string());
  cairn::testing::expect_read_or_refused(
      [&] {
        const cairn::ImageSequence sequence(path);
        for (std::size_t i = 0; i < sequence.frames().size(); ++i)
          static_cast<void>(sequence.read(i));
      },
      path.string());
  return 0;
}
