// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/file.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <filesystem>
#include <functional>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include "cairn/core/detail/files_read.hpp"
#include "cairn/core/error.hpp"

#include "support/refusal.hpp"
#include "support/temporary_folder.hpp"
#include "support/without_standard_input.hpp"

namespace cairn {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::read_text;
using testing::refusal;
using testing::TemporaryFolder;
using testing::WithoutStandardInput;

std::vector<std::string> lines_of(const std::filesystem::path& path, std::size_t block_size) {
  FileReader file(path);
  LineReader reader(file, block_size);
  std::vector<std::string> lines;
  while (const auto line = reader.next()) lines.emplace_back(*line);
  return lines;
}

TEST(LineReader, CutsLinesWhateverTheBlockSize) {
  const TemporaryFolder folder;
  const auto path = folder.write("a", "one\n\ntwo two\nlast");
  for (const std::size_t block : {0UL, 1UL, 2UL, 3UL, 5UL, 16UL, 1000UL}) {
    EXPECT_THAT(lines_of(path, block), ElementsAre("one", "", "two two", "last")) << block;
  }
}

TEST(LineReader, KnowsWhetherTheLastLineEnded) {
  const TemporaryFolder folder;
  for (const auto& [content, terminated] : {std::pair{"a\nb\n", true}, std::pair{"a\nb", false}}) {
    FileReader file(folder.write("a", content));
    LineReader reader(file);
    while (reader.next()) {
    }
    EXPECT_EQ(reader.line_was_terminated(), terminated);
    EXPECT_EQ(reader.line_number(), 2U);
    EXPECT_EQ(reader.bytes_read(), std::string(content).size());
  }
}

TEST(LineReader, ReportsALastLineThatMayHaveBeenCutOff) {
  for (const auto& [content, loss] :
       {std::pair{"1.5\n2.5\n", ""}, std::pair{"1.5\n2.5\n ", ""}, std::pair{"", ""},
        std::pair{"1.5\n2.", "a:2: the last line does not end; the file may have been cut off"}}) {
    std::string reported;
    MemoryReader source(content, "a");
    LineReader reader(source, [&](const Remark& remark) {
      EXPECT_EQ(remark.kind, RemarkKind::kLoss);
      reported += remark.text;
    });
    while (reader.next()) {
    }
    EXPECT_EQ(reported, loss);
  }
}

TEST(LineReader, FindsNothingInAnEmptyFile) {
  const TemporaryFolder folder;
  EXPECT_TRUE(lines_of(folder.write("a", ""), 8).empty());
}

TEST(LineReader, LeavesOutAByteOrderMarkAtTheStartOnly) {
  const TemporaryFolder folder;
  const auto path = folder.write("a", "\xEF\xBB\xBFone\n\xEF\xBB\xBFtwo\n");
  for (const std::size_t block : {1UL, 2UL, 3UL, 1000UL}) {
    EXPECT_THAT(lines_of(path, block), ElementsAre("one", "\xEF\xBB\xBFtwo")) << block;
  }
  EXPECT_THAT(lines_of(folder.write("b", "\xEF\xBB\xBF"), 2), ElementsAre(""));
}

// As many bytes as are asked for, all alike; without a size, as a pipe.
class Endless final : public ByteSource {
 public:
  const std::string& name() const override { return name_; }
  std::optional<std::uint64_t> size() const override { return std::nullopt; }
  std::size_t read(char* buffer, std::size_t capacity) override {
    std::fill_n(buffer, capacity, 'x');
    given_ += capacity;
    return capacity;
  }
  void rewind() override {}
  std::uint64_t given() const { return given_; }

 private:
  std::string name_ = "endless";
  std::uint64_t given_ = 0;
};

// Counts the calls that come after its end, where a terminal would wait for its user again.
class Ending final : public ByteSource {
 public:
  explicit Ending(std::string_view bytes) : reader_(bytes, "ending") {}
  const std::string& name() const override { return reader_.name(); }
  std::optional<std::uint64_t> size() const override { return std::nullopt; }
  std::size_t read(char* buffer, std::size_t capacity) override {
    const std::size_t count = reader_.read(buffer, capacity);
    ends_ += count == 0 ? 1 : 0;
    return count;
  }
  void rewind() override { reader_.rewind(); }
  int ends() const { return ends_; }

 private:
  MemoryReader reader_;
  int ends_ = 0;
};

TEST(LineReader, LearnsOfTheEndOnce) {
  for (const char* const content : {"", "a", "a\n"}) {
    Ending source(content);
    LineReader lines(source);
    while (lines.next()) {
    }
    EXPECT_EQ(lines.next(), std::nullopt);
    EXPECT_EQ(source.ends(), 1) << content;
  }
}

TEST(LineReader, RefusesALineWithoutEnd) {
  Endless source;
  LineReader lines(source);
  try {
    lines.next();
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::kInput);
    EXPECT_THAT(error.what(), HasSubstr("endless:1: a line of more than 67108864 bytes"));
  }
  EXPECT_LE(source.given(), 2 * kLongestLine + (std::size_t{1} << 20));
}

// More bytes than it says, as a file that grew after it was opened, or one in /proc.
class Grown final : public ByteSource {
 public:
  Grown(std::uint64_t said, std::string_view bytes) : said_(said), reader_(bytes, "grown") {}
  const std::string& name() const override { return reader_.name(); }
  std::optional<std::uint64_t> size() const override { return said_; }
  std::size_t read(char* buffer, std::size_t capacity) override {
    most_asked_for_ = std::max(most_asked_for_, capacity);
    return reader_.read(buffer, capacity);
  }
  void rewind() override { reader_.rewind(); }
  std::size_t most_asked_for() const { return most_asked_for_; }

 private:
  std::size_t most_asked_for_ = 0;
  std::uint64_t said_;
  MemoryReader reader_;
};

TEST(BlockSize, IsThatOfASmallSourceAndOneByteMoreUpToOneMebibyte) {
  const auto of = [](std::uint64_t size) { return block_size_for(Grown(size, "")); };
  EXPECT_EQ(of(0), 4096U);
  EXPECT_EQ(of(4095), 4096U);
  EXPECT_EQ(of(4096), 4097U);
  EXPECT_EQ(of(100'000), 100'001U);
  EXPECT_EQ(of((1U << 20U) - 1), 1U << 20U);
  EXPECT_EQ(of(std::numeric_limits<std::uint64_t>::max()), 1U << 20U);
  EXPECT_EQ(block_size_for(Endless()), 1U << 20U);
}

TEST(BlockSize, OfASourceThatHoldsMoreThanItSaysAllIsRead) {
  std::string bytes;
  for (int i = 0; i < 20'000; ++i) bytes += std::to_string(i) + "\n";
  for (const std::uint64_t said : {std::uint64_t{0}, std::uint64_t{5000}}) {
    Grown source(said, bytes);
    EXPECT_EQ(read_all(source), bytes);
    source.rewind();
    LineReader lines(source);
    std::uint64_t last = 0;
    while (const auto line = lines.next()) last = std::stoull(std::string(*line));
    EXPECT_EQ(last, 19'999U);
    EXPECT_EQ(lines.bytes_read(), bytes.size());
  }
}

TEST(LineReader, KeepsNoMoreThanABlockOfALongFile) {
  std::string bytes;
  for (int i = 0; i < 20'000; ++i) bytes += std::to_string(i) + "\n";
  Grown source(bytes.size(), bytes);
  LineReader lines(source, 4096);
  while (lines.next()) {
  }
  EXPECT_EQ(lines.line_number(), 20'000U);
  EXPECT_LE(source.most_asked_for(), 4096U);
}

TEST(ReadAll, TakesOneByteMoreThanASourceThatSaysHowMuchItHolds) {
  const std::string bytes(std::size_t{3} << 20U, 'x');
  Grown source(bytes.size(), bytes);
  EXPECT_EQ(read_all(source), bytes);
  EXPECT_EQ(source.most_asked_for(), bytes.size() + 1);
}

TEST(FileReader, KnowsTheSizeOfAFileAndReadsItAgain) {
  const TemporaryFolder folder;
  FileReader file(folder.write("a", "content"));
  EXPECT_EQ(file.size(), 7U);
  EXPECT_EQ(read_all(file), "content");
  file.rewind();
  EXPECT_EQ(read_all(file), "content");
}

TEST(FileReader, NamesWhyReadingFails) {
  // The first page of a process is never there.
  if (!std::filesystem::exists("/proc/self/mem"))
    GTEST_SKIP() << "no /proc: a failing read was not tested";
  FileReader file("/proc/self/mem");
  char byte = ' ';
  EXPECT_THAT(refusal(ErrorKind::kInput, [&] { file.read(&byte, 1); }),
              HasSubstr("/proc/self/mem: cannot be read: Input/output error"));
}

// A pipe that keeps what is written to it, to read it back.
class Pipe {
 public:
  explicit Pipe(const std::filesystem::path& path) {
    if (::mkfifo(path.c_str(), 0600) != 0) throw std::runtime_error("mkfifo failed");
    descriptor_ = ::open(path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
  }
  ~Pipe() { ::close(descriptor_); }
  Pipe(const Pipe&) = delete;
  Pipe& operator=(const Pipe&) = delete;

  std::string content() const {
    std::array<char, 64> bytes = {};
    const ssize_t count = ::read(descriptor_, bytes.data(), bytes.size());
    return {bytes.data(), static_cast<std::size_t>(std::max<ssize_t>(count, 0))};
  }

 private:
  int descriptor_;
};

TEST(FileReader, ReadsAPipeOnce) {
  const TemporaryFolder folder;
  const Pipe pipe(folder / "pipe");
  FileReader file(folder / "pipe");
  EXPECT_EQ(file.size(), std::nullopt);
  EXPECT_THAT(refusal(ErrorKind::kInput, [&] { file.rewind(); }),
              HasSubstr("pipe: cannot be read: Illegal seek"));
}

TEST(FileReader, EndsWhateverErrorCameBefore) {
  const TemporaryFolder folder;
  FileReader file(folder.write("a", ""));
  char byte = ' ';
  errno = EINTR;
  EXPECT_EQ(file.read(&byte, 1), 0U);
}

TEST(FileReader, RefusesADeviceWithoutEnd) {
  if (!std::filesystem::exists("/dev/zero"))
    GTEST_SKIP() << "no /dev/zero: a file without end was not tested";
  FileReader file("/dev/zero");
  std::vector<char> block(std::size_t{1} << 24);
  std::uint64_t count = 0;
  try {
    while (count <= 2 * kLongestStream) count += file.read(block.data(), block.size());
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("/dev/zero: more than 1073741824 bytes"));
  }
  EXPECT_EQ(count, kLongestStream);
}

// Another program may do that at any time; bytes in a mapping would be gone, and the process with them.
TEST(FileReader, OutlivesAFileThatIsCutShortWhileItIsRead) {
  const TemporaryFolder folder;
  const auto path = folder.write("a", std::string(std::size_t{1} << 22, 'x'));
  FileReader file(path);
  EXPECT_EQ(file.in_memory(), std::nullopt);
  std::string start(4096, ' ');
  ASSERT_EQ(file.read(start.data(), start.size()), start.size());
  std::filesystem::resize_file(path, 5000);
  EXPECT_EQ(read_all(file).size(), 5000U - start.size());
}

TEST(FileReader, NamesWhatItCannotRead) {
  const TemporaryFolder folder;
  const auto message_for = [](const std::filesystem::path& path) -> std::string {
    try {
      const FileReader file(path);
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::kInput);
      return error.what();
    }
    return "no error";
  };
  EXPECT_THAT(message_for(folder / "missing"), HasSubstr("missing: cannot be read: No such file"));
  EXPECT_THAT(message_for(folder.path()), HasSubstr("Is a directory"));
}

TEST(FileReader, RefusesAFileThatIsToBeWritten) {
  const TemporaryFolder folder;
  const auto input = folder.write("input", "what would be lost");
  const auto other = folder.write("other", "left alone");
  std::filesystem::create_symlink("input", folder / "symlink");
  std::filesystem::create_hard_link(input, folder / "hard");
  for (const char* const name : {"input", "symlink", "hard"}) {
    detail::refuse_to_read({{"--csv", folder / "missing"}, {"--json", folder / name}});
    EXPECT_EQ(refusal(ErrorKind::kMisuse, [&] { read_file(input); }),
              "--json: " + input.string() + " is an input too; expected a file of its own")
        << name;
    EXPECT_EQ(read_file(other), "left alone");
  }
  detail::refuse_to_read({});
  EXPECT_EQ(read_file(input), "what would be lost");
}

std::ptrdiff_t entries_in(const std::filesystem::path& folder) {
  return std::distance(std::filesystem::directory_iterator(folder), {});
}

void write_text(const std::filesystem::path& path, std::string_view text) {
  write_file(path, [&](const ByteSink& sink) { sink(text); });
}

TEST(WriteFile, WritesAllOrNothing) {
  const TemporaryFolder folder;
  const auto path = folder.write("a", "before");
  EXPECT_THROW(write_file(path,
                          [](const ByteSink& sink) {
                            sink("half");
                            throw Error(ErrorKind::kInput, "", "broken", "");
                          }),
               Error);
  EXPECT_EQ(read_text(path), "before");
  EXPECT_EQ(entries_in(folder.path()), 1);
  write_text(path, "after");
  EXPECT_EQ(read_text(path), "after");
  EXPECT_EQ(entries_in(folder.path()), 1);
}

TEST(WriteFile, LeavesNoFileOpen) {
  const TemporaryFolder folder;
  const Pipe pipe(folder / "pipe");
  const auto fail = [](const ByteSink&) { throw std::runtime_error("broken"); };
  const std::ptrdiff_t before = entries_in("/proc/self/fd");
  for (const auto& path : {folder / "a", folder / "pipe"}) {
    write_text(path, "x");
    EXPECT_THROW(write_file(path, fail), std::runtime_error);
  }
  sync_files(folder.path());
  EXPECT_EQ(read_file(folder / "a"), "x");
  EXPECT_THROW(read_file(folder.path()), Error);
  EXPECT_EQ(entries_in("/proc/self/fd"), before);
}

TEST(WriteFile, WorksWithoutAStandardInput) {
  const TemporaryFolder folder;
  const Pipe pipe(folder / "pipe");
  const auto fail = [](const ByteSink&) { throw std::runtime_error("broken"); };
  {
    const WithoutStandardInput closed;
    write_text(folder / "a", "x");
    write_text(folder / "pipe", "x");
    sync_files(folder.path());
    EXPECT_EQ(read_file(folder / "a"), "x");
    for (const char* const name : {"b", "pipe"}) {
      EXPECT_THROW(write_file(folder / name, fail), std::runtime_error);
    }
    EXPECT_EQ(::fcntl(0, F_GETFD), -1) << "left open";
  }
  EXPECT_EQ(pipe.content(), "x");
  EXPECT_EQ(entries_in(folder.path()), 2);
}

TEST(WriteFile, WritesToTheFolderThatOneIsIn) {
  const TemporaryFolder folder;
  const auto before = std::filesystem::current_path();
  std::filesystem::current_path(folder.path());
  EXPECT_NO_THROW(write_text("a", "x"));
  std::filesystem::current_path(before);
  EXPECT_EQ(read_text(folder / "a"), "x");
}

TEST(WriteFile, LeavesAFileEmptyToWhichNothingIsWritten) {
  const TemporaryFolder folder;
  folder.write("a", "before");
  write_text(folder / "a", "");
  EXPECT_EQ(std::filesystem::file_size(folder / "a"), 0U);
}

TEST(WriteFile, GivesANewFileTheRightsThatTheMaskLeaves) {
  const TemporaryFolder folder;
  for (const mode_t left_out : {0U, 07U, 0777U}) {
    const mode_t mask = ::umask(left_out);
    write_text(folder / std::to_string(left_out), "x");
    ::umask(mask);
    EXPECT_EQ(std::filesystem::status(folder / std::to_string(left_out)).permissions(),
              std::filesystem::perms(0666U & ~left_out));
  }
}

TEST(WriteFile, FillsAPipe) {
  const TemporaryFolder folder;
  const Pipe pipe(folder / "pipe");
  write_text(folder / "pipe", "through");
  EXPECT_EQ(pipe.content(), "through");
  EXPECT_TRUE(std::filesystem::is_fifo(folder / "pipe"));
}

// Each writes its number, and waits for the next.
void write_at_once(const std::filesystem::path& path, int writers,
                   const std::function<void()>& meanwhile) {
  if (writers == 0) {
    meanwhile();
    return;
  }
  write_file(path, [&](const ByteSink& sink) {
    sink(std::to_string(writers));
    write_at_once(path, writers - 1, meanwhile);
  });
  EXPECT_EQ(read_text(path), std::to_string(writers));
}

TEST(WriteFile, RefusesMoreWritersOfOneFileAtOnceThanItHasNamesFor) {
  const TemporaryFolder folder;
  write_at_once(folder / "a", 64, [&] {
    EXPECT_THAT(refusal(ErrorKind::kStorage, [&] { write_text(folder / "a", "x"); }),
                HasSubstr("a: cannot be written: Device or resource busy"));
  });
  EXPECT_EQ(entries_in(folder.path()), 1);
}

TEST(WriteFile, TakesOverWhatAKilledProcessLeft) {
  const TemporaryFolder folder;
  const auto path = folder.write("a", "before");
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    write_file(path, [](const ByteSink& sink) {
      sink("more than half of what was to be written");
      ::raise(SIGKILL);
    });
    ::_exit(0);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFSIGNALED(status));
  EXPECT_EQ(read_text(path), "before");
  ASSERT_EQ(read_text(folder / ".a.cairn-unfinished"), "more than half of what was to be written");
  write_text(path, "after");
  EXPECT_EQ(read_text(path), "after");
  EXPECT_EQ(entries_in(folder.path()), 1);
}

TEST(WriteFile, WritersOfOneFileDoNotMeet) {
  const TemporaryFolder folder;
  const auto path = folder / "a";
  write_file(path, [&](const ByteSink& outer) {
    outer("outer ");
    write_text(path, "inner");
    EXPECT_EQ(read_text(path), "inner");
    outer("whole");
  });
  EXPECT_EQ(read_text(path), "outer whole");
  const auto write_many = [&](const std::string& content) {
    for (int i = 0; i < 200; ++i) {
      write_file(
          path, [&](const ByteSink& sink) { sink(content); }, Durability::kLater);
    }
  };
  std::thread other([&] { write_many(std::string(5000, 'a')); });
  write_many(std::string(3000, 'b'));
  other.join();
  const std::string content = read_text(path);
  EXPECT_TRUE(content == std::string(5000, 'a') || content == std::string(3000, 'b'));
  EXPECT_EQ(entries_in(folder.path()), 1);
}

TEST(WriteFile, WritesNamesOfAnyLength) {
  const TemporaryFolder folder;
  const auto path = folder / std::string(255, 'n');
  write_text(path, "x");
  EXPECT_EQ(read_text(path), "x");
}

TEST(WriteFile, LeavesAloneWhatStandsWhereItsTemporaryFileWould) {
  const TemporaryFolder folder;
  const auto other = folder.write("other", "of somebody");
  std::filesystem::create_symlink(other, folder / ".a.cairn-unfinished");
  std::filesystem::create_directory(folder / ".a.cairn-unfinished-1");
  write_text(folder / "a", "x");
  EXPECT_EQ(read_text(folder / "a"), "x");
  EXPECT_EQ(read_text(other), "of somebody");
  EXPECT_TRUE(std::filesystem::is_symlink(folder / ".a.cairn-unfinished"));
}

TEST(WriteFile, TakesOverNoFileThatHasAnotherNameOrOwner) {
  const TemporaryFolder folder;
  const auto other = folder.write("other", "of somebody");
  std::filesystem::create_hard_link(other, folder / ".a.cairn-unfinished");
  write_text(folder / "a", "x");
  EXPECT_EQ(read_text(folder / "a"), "x");
  EXPECT_EQ(read_text(other), "of somebody");
  if (::geteuid() != 0) GTEST_SKIP() << "not root: a file of another user was not tested";
  const auto theirs = folder.write(".b.cairn-unfinished", "theirs");
  ASSERT_EQ(::chown(theirs.c_str(), 12345, 12345), 0);
  write_text(folder / "b", "x");
  struct stat status = {};
  ASSERT_EQ(::stat((folder / "b").c_str(), &status), 0);
  EXPECT_EQ(status.st_uid, ::geteuid());
  EXPECT_EQ(read_text(theirs), "theirs");
}

TEST(WriteFile, FollowsLinksToFilesThatDoNotExistYet) {
  const TemporaryFolder folder;
  std::filesystem::create_directory(folder / "real");
  std::filesystem::create_symlink("real/a", folder / "first");
  std::filesystem::create_symlink(folder / "first", folder / "second");
  write_text(folder / "second", "x");
  EXPECT_EQ(read_text(folder / "real/a"), "x");
  EXPECT_TRUE(std::filesystem::is_symlink(folder / "first"));
  EXPECT_TRUE(std::filesystem::is_symlink(folder / "second"));
  std::filesystem::create_symlink("ring", folder / "ring");
  EXPECT_THROW(write_text(folder / "ring", "x"), Error);
  EXPECT_TRUE(std::filesystem::is_symlink(folder / "ring"));
}

TEST(WriteFile, FollowsLinksAndKeepsRights) {
  const TemporaryFolder folder;
  const auto path = folder.write("a", "before");
  ASSERT_EQ(::chmod(path.c_str(), 0640), 0);
  std::filesystem::create_symlink(path, folder / "link");
  write_text(folder / "link", "after");
  EXPECT_TRUE(std::filesystem::is_symlink(folder / "link"));
  EXPECT_EQ(read_text(path), "after");
  EXPECT_EQ(static_cast<int>(std::filesystem::status(path).permissions()), 0640);
}

TEST(WriteFile, NamesWhyItCannotWrite) {
  const TemporaryFolder folder;
  sockaddr_un address = {};
  address.sun_family = AF_UNIX;
  const std::string name = (folder / "socket").string();
  name.copy(address.sun_path, sizeof address.sun_path - 1);
  const int socket = ::socket(AF_UNIX, SOCK_STREAM, 0);
  ASSERT_EQ(::bind(socket, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  ::close(socket);
  for (const auto& [path, reason] : {std::pair{folder / "no" / "such", "No such file or directory"},
                                     std::pair{folder.path(), "Is a directory"},
                                     std::pair{folder / "socket", "No such device or address"}}) {
    EXPECT_EQ(refusal(ErrorKind::kStorage, [&] { write_text(path, "x"); }),
              path.string() + ": cannot be written: " + reason);
  }
}

TEST(WriteFile, ReportsAFullDisk) {
  if (!std::filesystem::exists("/dev/full"))
    GTEST_SKIP() << "no /dev/full: a full disk was not tested";
  try {
    write_text("/dev/full", "x");
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("No space left on device"));
  }
}

TEST(WriteFile, ThreadsWriteSideBySideAndKeepTheModeMask) {
  const TemporaryFolder folder;
  const mode_t mask = ::umask(027);
  const auto write_many = [&](const std::string& name) {
    for (int i = 0; i < 200; ++i) {
      write_file(
          folder / (name + std::to_string(i)), [&](const ByteSink& sink) { sink(name); },
          Durability::kLater);
    }
  };
  std::thread other([&] { write_many("a"); });
  write_many("b");
  other.join();
  EXPECT_EQ(::umask(mask), 027U);
  sync_files(folder.path());
  for (const std::string name : {"a", "b"}) {
    for (int i = 0; i < 200; ++i) {
      const auto path = folder / (name + std::to_string(i));
      EXPECT_EQ(read_text(path), name);
      EXPECT_EQ(std::filesystem::status(path).permissions(), std::filesystem::perms(0640));
    }
  }
}

TEST(SyncFiles, NamesAFolderThatIsNotThere) {
  EXPECT_EQ(refusal(ErrorKind::kStorage, [] { sync_files("/no/such/folder"); }),
            "/no/such/folder: cannot be written: No such file or directory");
}

TEST(HashFile, IsXxh3) {
  const TemporaryFolder folder;
  // The published test vector of the empty input.
  EXPECT_EQ(hash_file(folder.write("a", "")), "xxh3:99aa06d3014798d86001c324468d497f");
  EXPECT_NE(hash_file(folder.write("a", "x")), hash_file(folder.write("b", "y")));
}

TEST(FilesRead, ListsTheFilesThatAreOpenedWhileItLives) {
  const TemporaryFolder folder;
  const auto first = folder.write("first", "1");
  const auto second = folder.write("second", "2");
  read_file(second);
  std::vector<std::filesystem::path> paths;
  {
    const detail::FilesRead outer;
    read_file(second);
    {
      const detail::FilesRead inner;
      read_file(first);
      EXPECT_EQ(inner.paths(), std::vector{first});
    }
    read_file(second);
    paths = outer.paths();
  }
  EXPECT_EQ(paths, (std::vector{second, first}));
  const std::string hash = detail::hash_files(paths);
  EXPECT_EQ(detail::hash_files(paths), hash);
  folder.write("first", "3");
  EXPECT_NE(detail::hash_files(paths), hash);
}

}  // namespace
}  // namespace cairn
