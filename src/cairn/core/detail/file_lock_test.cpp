// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/detail/file_lock.hpp"

#include <cerrno>
#include <csignal>
#include <filesystem>

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "cairn/core/error.hpp"

#include "support/refusal.hpp"
#include "support/temporary_folder.hpp"
#include "support/without_standard_input.hpp"

namespace cairn::detail {
namespace {

using testing::read_text;
using testing::refusal;
using testing::TemporaryFolder;
using testing::WithoutStandardInput;
using State = FileLock::State;

TEST(FileLock, IsHeldByOneAtATime) {
  const TemporaryFolder folder;
  {
    const FileLock first(folder / "a", true);
    EXPECT_EQ(first.state(), State::kLocked);
    EXPECT_TRUE(first.is_new());
    EXPECT_EQ(first.error_number(), 0);
    EXPECT_EQ(std::filesystem::status(folder / "a").permissions(), std::filesystem::perms(0600));
    const FileLock second(folder / "a", true);
    EXPECT_EQ(second.state(), State::kTaken);
    EXPECT_LT(second.descriptor(), 0);
  }
  const FileLock third(folder / "a", true);
  EXPECT_EQ(third.state(), State::kLocked);
  EXPECT_FALSE(third.is_new());
  EXPECT_EQ(third.error_number(), 0);
}

TEST(FileLock, WorksWithoutAStandardInput) {
  const TemporaryFolder folder;
  const WithoutStandardInput closed;
  for (const bool is_new : {true, false}) {
    const FileLock lock(folder / "a", true);
    EXPECT_EQ(lock.state(), State::kLocked);
    EXPECT_EQ(lock.descriptor(), 0);
    EXPECT_EQ(lock.error_number(), 0);
    EXPECT_EQ(lock.is_new(), is_new);
  }
}

TEST(FileLock, SaysWhyItIsNotHeld) {
  const TemporaryFolder folder;
  const FileLock first(folder / "a", true);
  EXPECT_NO_THROW(first.require());
  const auto refusal_of = [&](const char* name) {
    return refusal(ErrorKind::kStorage, [&] { FileLock(folder / name, true).require(); });
  };
  EXPECT_EQ(refusal_of("a"), (folder / "a").string() +
                                 ": another process is writing it; expected one process a folder");
  EXPECT_EQ(refusal_of("no/such"),
            (folder / "no/such").string() + ": cannot be written: No such file or directory");
  std::filesystem::create_hard_link(folder / "a", folder / "b");
  EXPECT_EQ(refusal_of("b"),
            (folder / "b").string() +
                ": is not a file that this user's processes leave; expected no such file");
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
  const FileLock lock(folder / "a", false);
  EXPECT_EQ(lock.state(), State::kLocked);
  EXPECT_FALSE(lock.is_new());
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
  if (::geteuid() != 0) GTEST_SKIP() << "not root: a file of another user was not tested";
  const auto theirs = folder.write("theirs", "of another user");
  ASSERT_EQ(::chown(theirs.c_str(), 12345, 12345), 0);
  EXPECT_EQ(FileLock(theirs, true).state(), State::kForeign);
}

}  // namespace
}  // namespace cairn::detail
