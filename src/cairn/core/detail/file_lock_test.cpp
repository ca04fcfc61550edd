// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/detail/file_lock.hpp"

#include <cerrno>
#include <csignal>
#include <filesystem>

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "support/temporary_folder.hpp"

namespace cairn::detail {
namespace {

using testing::read_text;
using testing::TemporaryFolder;
using State = FileLock::State;

TEST(FileLock, IsHeldByOneAtATime) {
  const TemporaryFolder folder;
  {
    const FileLock first(folder / "a", true);
    EXPECT_EQ(first.state(), State::kLocked);
    EXPECT_TRUE(first.is_new());
    const FileLock second(folder / "a", true);
    EXPECT_EQ(second.state(), State::kTaken);
    EXPECT_LT(second.descriptor(), 0);
  }
  const FileLock third(folder / "a", true);
  EXPECT_EQ(third.state(), State::kLocked);
  EXPECT_FALSE(third.is_new());
  EXPECT_EQ(third.error_number(), 0);
}

// Then the first file that it opens has the number 0.
TEST(FileLock, WorksWithoutAStandardInput) {
  const TemporaryFolder folder;
  folder.write("a", "");
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    ::close(0);
    for (int i = 0; i < 2; ++i) {
      const FileLock lock(folder / "a", false);
      if (lock.state() != State::kLocked || lock.descriptor() != 0) ::_exit(1);
    }
    ::_exit(0);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_EQ(status, 0);
}

TEST(FileLock, EndsWithAKilledProcess) {
  const TemporaryFolder folder;
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    const FileLock lock(folder / "a", true);
    ::raise(SIGKILL);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFSIGNALED(status));
  ASSERT_TRUE(std::filesystem::exists(folder / "a"));
  EXPECT_EQ(FileLock(folder / "a", false).state(), State::kLocked);
}

TEST(FileLock, IsFreeAgainUnderItsNameWhenTheFileWasRenamed) {
  const TemporaryFolder folder;
  const FileLock first(folder / "a", true);
  std::filesystem::rename(folder / "a", folder / "b");
  const FileLock second(folder / "a", true);
  EXPECT_EQ(second.state(), State::kLocked);
  EXPECT_TRUE(second.is_new());
}

TEST(FileLock, MakesAFileOnlyIfAskedTo) {
  const TemporaryFolder folder;
  const FileLock lock(folder / "a", false);
  EXPECT_EQ(lock.state(), State::kFailed);
  EXPECT_EQ(lock.error_number(), ENOENT);
  EXPECT_FALSE(std::filesystem::exists(folder / "a"));
  EXPECT_EQ(FileLock(folder / "no/such", true).error_number(), ENOENT);
}

TEST(FileLock, LeavesFilesOfOthersAlone) {
  const TemporaryFolder folder;
  const auto other = folder.write("other", "mine");
  std::filesystem::create_hard_link(other, folder / "second name");
  EXPECT_EQ(FileLock(folder / "second name", true).state(), State::kForeign);
  std::filesystem::create_symlink(other, folder / "link");
  EXPECT_EQ(FileLock(folder / "link", true).error_number(), ELOOP);
  EXPECT_EQ(read_text(other), "mine");
  if (::geteuid() == 0) {
    const auto theirs = folder.write("theirs", "of another user");
    ASSERT_EQ(::chown(theirs.c_str(), 12345, 12345), 0);
    EXPECT_EQ(FileLock(theirs, true).state(), State::kForeign);
  }
}

}  // namespace
}  // namespace cairn::detail
