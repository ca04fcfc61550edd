// SPDX-License-Identifier: BSD-3-Clause
// Pipes, full disks and interrupts.
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "cli.hpp"

namespace cairn::testing {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

class StreamsTest : public CliTest {};

TEST_F(StreamsTest, MapIsReadFromAPipe) {
  write_plain();
  const CommandResult result =
      cairn({"info", "/dev/stdin", "--json", "-"}, {.input = content("plain.map")});
  ASSERT_EQ(result.exit_code, kDone) << result.errors;
  const Json input = Json::parse(result.output).at("inputs").at("map");
  EXPECT_EQ(input.at("landmarks"), 3);
  EXPECT_TRUE(input.at("hash").is_null()) << "a pipe cannot be read twice";
}

TEST_F(StreamsTest, BinaryMapIsReadFromAPipe) {
  write_map(full_map(), path("full.cairn"));
  const CommandResult result =
      cairn({"convert", "/dev/stdin", "copy.cairn"}, {.input = content("full.cairn")});
  ASSERT_EQ(result.exit_code, kDone) << result.errors;
  EXPECT_EQ(content("copy.cairn"), content("full.cairn"));
}

TEST_F(StreamsTest, BrokenMapFromAPipeIsRefused) {
  const CommandResult result = cairn({"info", "/dev/stdin"}, {.input = "FRAME 1\n"});
  EXPECT_EQ(result.exit_code, kBadInput);
  EXPECT_THAT(result.errors, HasSubstr("/dev/stdin:1:"));
}

TEST_F(StreamsTest, FullDiskUnderStdoutIsAnError) {
  write_pair();
  for (const Words& words :
       {Words{"info", "source.map"}, Words{"demo", "--synthetic", "--json", "-"},
        Words{"align", "source.map", "target.map", "--trace", "--json", "-"}}) {
    const CommandResult result = cairn(words, {.output_to = "/dev/full"});
    EXPECT_EQ(result.exit_code, kSystemError);
    EXPECT_EQ(result.errors, "cairn: stdout: cannot be written\n");
  }
}

TEST_F(StreamsTest, FullDiskUnderTheDocumentIsAnError) {
  write_plain();
  expect_refusal({"info", "plain.map", "--json", "/dev/full"}, kSystemError,
                 {"/dev/full", "No space left"});
}

// In a shell, because it is the shell that closes streams.
TEST_F(StreamsTest, ClosedStreamsDoNotEndUpInOutputFiles) {
  const LandmarkMap map = write_plain();
  const std::string tool = CAIRN_TOOL;
  const auto result = run_command(
      {"/bin/sh", "-c", tool + " convert plain.map copy.map >&- 2>&- <&-"}, {.folder = path("")});
  EXPECT_EQ(result.exit_code, kSystemError) << "the answer could not be printed";
  EXPECT_EQ(content("copy.map"), content("plain.map"));
}

TEST_F(StreamsTest, ReaderThatLeavesEarlyCostsNoFile) {
  write_pair();
  const std::string tool = CAIRN_TOOL;
  const auto result = run_command(
      {"/bin/sh", "-c", tool + " align source.map target.map --json result.json -o out.map | true"},
      {.folder = path("")});
  EXPECT_THAT(result.errors, IsEmpty());
  EXPECT_EQ(Json::parse(content("result.json")).at("results").size(), 1U);
  EXPECT_EQ(read_map(path("out.map")).landmark_count(), 600U);
}

// A pipe without a reader, from the first byte on.
TEST_F(StreamsTest, AnswerThatNobodyReadsCostsNoFile) {
  ASSERT_EQ(::mkfifo(path("pipe").c_str(), 0600), 0);
  constexpr std::size_t kPairs = 200;  // their lines are more than stdio's buffer holds
  std::string pairs = "source,target\n";
  for (std::size_t i = 0; i < kPairs; ++i) pairs += fmt::format("missing{}.map,missing.map\n", i);
  write("pairs.csv", pairs);
  const std::string tool = CAIRN_TOOL;
  const auto result = run_command(
      {"/bin/sh", "-c",
       "exec 3<>pipe >pipe 3<&-; exec " + tool + " align --pairs pairs.csv --json all.json"},
      {.folder = path("")});
  EXPECT_EQ(result.exit_code, 128 + SIGPIPE);
  EXPECT_THAT(result.errors, IsEmpty());
  EXPECT_EQ(Json::parse(content("all.json")).at("results").size(), kPairs);
}

TEST_F(StreamsTest, QuietSilencesRemarksButNotErrors) {
  write_plain();
  EXPECT_EQ(cairn({"convert", "plain.map", "plain.ply", "--quiet"}).errors, "");
  EXPECT_THAT(cairn({"info", "missing.map", "--quiet"}).errors, HasSubstr("missing.map"));
}

TEST_F(StreamsTest, NoProgressWhereStderrIsNoTerminal) {
  EXPECT_EQ(cairn({"demo", "--synthetic"}).errors, "");
}

// Landmarks without end; a piece is more than a pipe holds, so that once it is fed the tool is known
// to be reading.
class EndlessMap {
 public:
  std::string next_piece() {
    std::string text;
    for (int i = 0; i < 5000; ++i) {
      text += fmt::format("LANDMARK {} 1 2 3 1 0 0 0 1 0 0 0 1 0\n", id_++);
    }
    return text;
  }

 private:
  std::uint64_t id_ = 0;
};

TEST_F(StreamsTest, InterruptStopsReadingAndLeavesNoFile) {
  Command command(CliTest::command({"convert", "/dev/stdin", "out.map"}),
                  {.folder = path(""), .input_stays_open = true});
  EndlessMap map;
  ASSERT_TRUE(command.feed(map.next_piece()));
  command.send(SIGINT);
  while (command.feed(map.next_piece())) continue;
  const CommandResult result = command.wait();
  EXPECT_EQ(result.exit_code, 128 + SIGINT);
  EXPECT_EQ(result.errors, "cairn: interrupted\n");
  EXPECT_THAT(files(), IsEmpty());
}

TEST_F(StreamsTest, InterruptEndsEvenAReaderThatWaitsForItsInput) {
  Command command(CliTest::command({"info", "/dev/stdin"}),
                  {.folder = path(""), .input_stays_open = true});
  EndlessMap map;
  ASSERT_TRUE(command.feed(map.next_piece()));
  command.send(SIGTERM);
  const CommandResult result = command.wait();
  EXPECT_EQ(result.exit_code, 128 + SIGTERM);
  EXPECT_EQ(result.errors, "cairn: interrupted\n");
}

// A pipe that is full and that nobody reads, as a stopped terminal is.
class FullPipe {
 public:
  explicit FullPipe(const std::filesystem::path& path) {
    EXPECT_EQ(::mkfifo(path.c_str(), 0600), 0);
    descriptor_ = ::open(path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
    const std::string block(4096, '.');
    while (::write(descriptor_, block.data(), block.size()) > 0) continue;
    EXPECT_EQ(errno, EAGAIN);
  }
  ~FullPipe() { ::close(descriptor_); }
  FullPipe(const FullPipe&) = delete;
  FullPipe& operator=(const FullPipe&) = delete;

 private:
  int descriptor_ = -1;
};

TEST_F(StreamsTest, InterruptEndsEvenIfNobodyReadsItsMessage) {
  const FullPipe pipe(path("pipe"));
  const std::string tool = CAIRN_TOOL;
  Command command(
      {"/bin/sh", "-c", "exec " + tool + " info /dev/stdin 2>pipe"},
      {.folder = path(""), .input_stays_open = true, .limit = std::chrono::seconds(120)});
  EndlessMap map;
  ASSERT_TRUE(command.feed(map.next_piece()));
  command.send(SIGINT);
  EXPECT_EQ(command.wait().exit_code, 128 + SIGINT);
}

}  // namespace
}  // namespace cairn::testing
