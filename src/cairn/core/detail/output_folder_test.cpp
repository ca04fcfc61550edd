// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/detail/output_folder.hpp"

#include <csignal>
#include <filesystem>
#include <list>
#include <optional>
#include <set>
#include <string>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"

#include "support/refusal.hpp"
#include "support/temporary_folder.hpp"

namespace cairn::detail {
namespace {

namespace fs = std::filesystem;
using ::testing::AnyOf;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::read_text;
using testing::TemporaryFolder;
using ::testing::UnorderedElementsAre;

std::set<std::string> names_in(const fs::path& folder) {
  std::set<std::string> names;
  for (const fs::path& entry : fs::directory_iterator(folder)) names.insert(entry.filename());
  return names;
}

void write(const fs::path& path, const std::string& text) {
  write_file(path, [&](const ByteSink& sink) { sink(text); });
}

std::string refusal(const fs::path& folder, ErrorKind kind = ErrorKind::kStorage) {
  return testing::refusal(kind, [&] { OutputFolder output(folder); });
}

// Fills a folder in a process that is killed before it commits.
void fill_and_die(const fs::path& folder) {
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    const OutputFolder output(folder);
    write(output.unfinished() / "a", "half");
    ::raise(SIGKILL);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFSIGNALED(status));
}

TEST(OutputFolder, AppearsWholeOrNotAtAll) {
  const TemporaryFolder folder;
  {
    const OutputFolder output(folder / "o");
    write(output.unfinished() / "a", "half");
    EXPECT_FALSE(fs::exists(folder / "o"));
  }
  EXPECT_THAT(names_in(folder.path()), IsEmpty());
  {
    OutputFolder output(folder / "o/");
    write(output.unfinished() / "a", "whole");
    output.commit();
    EXPECT_EQ(read_text(folder / "o/a"), "whole");
  }
  EXPECT_THAT(names_in(folder.path()), UnorderedElementsAre("o"));
  EXPECT_THAT(names_in(folder / "o"), UnorderedElementsAre("a"));
}

TEST(OutputFolder, ClearsWhatAKilledProcessLeft) {
  const TemporaryFolder folder;
  fs::create_directory(folder / "empty");
  for (const fs::path& path : {folder / "o", folder / "empty"}) {
    fill_and_die(path);
    fill_and_die(path);
    OutputFolder output(path);
    EXPECT_THAT(names_in(output.unfinished()), IsEmpty());
    write(output.unfinished() / "b", "whole");
    output.commit();
  }
  EXPECT_THAT(names_in(folder.path()), UnorderedElementsAre("o", "empty"));
  EXPECT_THAT(names_in(folder / "o"), UnorderedElementsAre("b"));
  EXPECT_THAT(names_in(folder / "empty"), UnorderedElementsAre("b"));
}

TEST(OutputFolder, SeveralDoNotMeetAndTheFirstWins) {
  const TemporaryFolder folder;
  fs::create_directory(folder / "empty");
  for (const fs::path& path : {folder / "o", folder / "empty"}) {
    OutputFolder first(path);
    write(first.unfinished() / "a", "first");
    OutputFolder second(path);
    write(second.unfinished() / "a", "second");
    EXPECT_EQ(read_text(first.unfinished() / "a"), "first");
    first.commit();
    const ErrorKind kind = path == folder / "o" ? ErrorKind::kStorage : ErrorKind::kMisuse;
    EXPECT_THAT(testing::refusal(kind, [&] { second.commit(); }),
                AnyOf(path.string() + ": cannot be written: Directory not empty",
                      path.string() + ": cannot be written: the folder is not empty; "
                                      "expected a new or an empty folder"));
    EXPECT_EQ(read_text(path / "a"), "first");
  }
}

TEST(OutputFolder, ThreadsFindFoldersOfTheirOwn) {
  const TemporaryFolder folder;
  const auto make_many = [&](const std::string& name) {
    for (int i = 0; i < 100; ++i) {
      const OutputFolder output(folder / "o");
      write(output.unfinished() / "a", name);
      EXPECT_EQ(read_text(output.unfinished() / "a"), name);
      EXPECT_THAT(names_in(output.unfinished()), UnorderedElementsAre("a"));
    }
  };
  std::thread other([&] { make_many("one"); });
  make_many("two");
  other.join();
  EXPECT_THAT(names_in(folder.path()), IsEmpty());
}

TEST(OutputFolder, KeepsAnEmptyFolderThatALinkNames) {
  const TemporaryFolder folder;
  fs::create_directory(folder / "empty");
  fs::permissions(folder / "empty", fs::perms(0750));
  fs::create_directory_symlink(folder / "empty", folder / "link");
  OutputFolder output(folder / "link");
  fs::create_directory(output.unfinished() / "tables");
  write(output.unfinished() / "tables/a", "whole");
  output.commit();
  EXPECT_EQ(read_text(folder / "empty/tables/a"), "whole");
  EXPECT_EQ(fs::status(folder / "empty").permissions(), fs::perms(0750));
  EXPECT_TRUE(fs::is_symlink(folder / "link"));
}

TEST(OutputFolder, MayBeTheFolderThatOneIsIn) {
  const TemporaryFolder folder;
  OutputFolder output(folder / ".");
  write(output.unfinished() / "a", "whole");
  output.commit();
  EXPECT_THAT(names_in(folder.path()), UnorderedElementsAre("a"));
}

TEST(OutputFolder, LeavesAloneWhatOthersWrote) {
  const TemporaryFolder folder;
  fs::create_directory(folder / ".o.cairn-unfinished");
  folder.write(".o.cairn-unfinished/thesis.txt", "years of work");
  folder.write(".o.cairn-unfinished-1", "a file");
  fs::create_directory(folder / "theirs");
  fs::create_directory_symlink("theirs", folder / ".o.cairn-unfinished-2");
  {
    OutputFolder output(folder / "o");
    EXPECT_THAT(names_in(folder / "theirs"), IsEmpty());
    output.commit();
  }
  EXPECT_TRUE(fs::is_directory(folder / "o"));
  EXPECT_EQ(read_text(folder / ".o.cairn-unfinished/thesis.txt"), "years of work");
  EXPECT_EQ(read_text(folder / ".o.cairn-unfinished-1"), "a file");
}

TEST(OutputFolder, TakesOverWhatAProcessLeftThatWasKilledAtItsStart) {
  const TemporaryFolder folder;
  fs::create_directory(folder / ".o.cairn-unfinished");
  {
    const OutputFolder output(folder / "o");
    EXPECT_EQ(output.unfinished(), folder / ".o.cairn-unfinished/o");
  }
  EXPECT_THAT(names_in(folder.path()), IsEmpty());
}

TEST(OutputFolder, HasNothingToDoWithTheNextOnceItIsCommitted) {
  const TemporaryFolder folder;
  std::optional<OutputFolder> first(folder / "o");
  first->commit();
  fs::rename(folder / "o", folder / "old");
  OutputFolder second(folder / "o");
  write(second.unfinished() / "a", "second");
  first.reset();
  second.commit();
  EXPECT_EQ(read_text(folder / "o/a"), "second");
}

TEST(OutputFolder, LeavesNothingWhereItCannotBe) {
  const TemporaryFolder folder;
  EXPECT_THAT(refusal(folder / std::string(256, 'n')),
              EndsWith("cannot be written: File name too long"));
  EXPECT_THAT(names_in(folder.path()), IsEmpty());
  rlimit files = {};
  ASSERT_EQ(::getrlimit(RLIMIT_NOFILE, &files), 0);
  const rlimit none = {0, files.rlim_max};
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &none), 0);
  const std::string of_new = refusal(folder / "o");
  const std::string of_empty = refusal(folder.path());
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &files), 0);
  EXPECT_THAT(of_new, EndsWith("o: cannot be written: Too many open files"));
  EXPECT_THAT(of_empty, EndsWith(": cannot be written: Too many open files"));
  EXPECT_THAT(names_in(folder.path()), IsEmpty());
}

TEST(OutputFolder, RefusesMoreOfOneNameAtOnceThanThereAreNamesFor) {
  const TemporaryFolder folder;
  std::list<OutputFolder> outputs;
  for (int i = 0; i < 64; ++i) outputs.emplace_back(folder / "o");
  EXPECT_THAT(refusal(folder / "o"), HasSubstr("there are too many unfinished folders beside it"));
}

TEST(OutputFolder, RefusesWhatIsInTheWay) {
  const TemporaryFolder folder;
  fs::create_directory(folder / "full");
  folder.write("full/a", "mine");
  EXPECT_THAT(refusal(folder / "full", ErrorKind::kMisuse),
              HasSubstr("full: cannot be written: the folder is not "
                        "empty; expected a new or an empty folder"));
  EXPECT_THAT(refusal(folder / "full/a", ErrorKind::kMisuse),
              EndsWith("cannot be written: it is a file; expected a new or an empty folder"));
  EXPECT_THAT(refusal(folder / "no/where"),
              EndsWith("cannot be written: No such file or directory"));
}

}  // namespace
}  // namespace cairn::detail
