// SPDX-License-Identifier: BSD-3-Clause
// The command line itself: help, and every way to get it wrong.
#include <algorithm>
#include <filesystem>
#include <set>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/report/report.hpp"

#include "cli.hpp"

namespace cairn::testing {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::MatchesRegex;
using ::testing::Not;

constexpr const char* kVerbs[] = {
    "demo",     "info", "convert", "align", "report",
#ifdef CAIRN_HAS_SIMULATION
    "simulate",
#endif
#ifdef CAIRN_HAS_ODOMETRY
    "map",
#endif
#ifdef CAIRN_HAS_MERGING
    "merge",
#endif
};

class UsageTest : public CliTest {};

TEST_F(UsageTest, WithoutArgumentsSaysHowToStart) {
  const CommandResult result = cairn({});
  EXPECT_EQ(result.exit_code, kWrongUsage);
  EXPECT_THAT(result.output, IsEmpty());
  EXPECT_THAT(result.errors, HasSubstr("Usage: cairn"));
  EXPECT_THAT(result.errors, HasSubstr("cairn demo"));
}

TEST_F(UsageTest, HelpListsTheVerbsAndExitCodes) {
  const std::string help = answer({"--help"});
  for (const char* const verb : kVerbs) {
    EXPECT_THAT(help, HasSubstr(std::string("\n  ") + verb));
  }
  EXPECT_THAT(help, HasSubstr("\n  evaluate"));
  EXPECT_THAT(help, HasSubstr("Exit codes: 0 done"));
  // What follows is no verb.
  EXPECT_THAT(help, HasSubstr("\n\nTry 'cairn demo'"));
  EXPECT_THAT(answer({"experiment", "--help"}), HasSubstr("\n\nExample: "));
}

TEST_F(UsageTest, VersionIsOneLineOnStdout) {
  EXPECT_THAT(answer({"--version"}), MatchesRegex("cairn [0-9]+\\.[0-9]+\\.[0-9]+\n"));
}

class VerbTest : public UsageTest, public ::testing::WithParamInterface<const char*> {};
INSTANTIATE_TEST_SUITE_P(All, VerbTest, ::testing::ValuesIn(kVerbs),
                         [](const auto& verb) { return std::string(verb.param); });

TEST_P(VerbTest, HelpHasAnExampleAndTheCommonOptions) {
  const std::string help = answer({GetParam(), "--help"});
  EXPECT_THAT(help, HasSubstr(std::string("Usage: cairn ") + GetParam()));
  EXPECT_THAT(help, HasSubstr("Example: "));
  EXPECT_THAT(help, HasSubstr(std::string("\n  cairn ") + GetParam() + " "));
  for (const char* const option : {"--json", "--quiet"}) EXPECT_THAT(help, HasSubstr(option));
}

TEST_P(VerbTest, HelpFitsATerminal) {
  const std::string help = answer({GetParam(), "--help"});
  for (std::size_t begin = 0; begin < help.size();) {
    const std::size_t end = help.find('\n', begin);
    EXPECT_LE(end - begin, 100U) << help.substr(begin, end - begin);
    begin = end + 1;
  }
}

// The options in a help text, as they are listed.
std::set<std::string> listed_options(const std::string& help) {
  std::set<std::string> names;
  std::istringstream lines(help);
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("  -")) names.insert(line.substr(2, line.find("  ", 2) - 2));
  }
  return names;
}

TEST_P(VerbTest, AllHelpListsWhatHelpListsAndTheHeadingsThatItNames) {
  const std::string help = answer({GetParam(), "--help"});
  const std::string all = answer({GetParam(), "--help-all"});
  const auto usual = listed_options(help);
  const auto every = listed_options(all);
  EXPECT_TRUE(std::includes(every.begin(), every.end(), usual.begin(), usual.end()));
  constexpr std::string_view kMore = "More options, which --help-all lists: ";
  const std::size_t more = help.find(kMore);
  ASSERT_EQ(more == std::string::npos, every == usual);
  if (more == std::string::npos) return;
  const std::size_t begin = more + kMore.size();
  std::istringstream headings(help.substr(begin, help.find('\n', begin) - begin));
  for (std::string heading; std::getline(headings >> std::ws, heading, ',');) {
    EXPECT_THAT(all, HasSubstr("\n" + heading + ":\n"));
    EXPECT_THAT(help, Not(HasSubstr("\n" + heading + ":\n")));
  }
}

TEST_F(UsageTest, HelpOfAlignLeavesOutWhatFewNeed) {
  const std::string help = answer({"align", "--help"});
  for (const char* const option : {"--initial ", "--scale", "--output", "--method", "--seed"}) {
    EXPECT_THAT(help, HasSubstr(option));
  }
  const std::string all = answer({"align", "--help-all"});
  for (const char* const option : {"--effort", "--trim", "--prior-odds", "--pose-format"}) {
    EXPECT_THAT(help, Not(HasSubstr(option)));
    EXPECT_THAT(all, HasSubstr(option));
  }
}

TEST_P(VerbTest, UnknownOptionIsRefusedByName) {
  expect_refusal({GetParam(), "a.map", "b.map", "--colour"}, kWrongUsage,
                 {"--colour", std::string("cairn ") + GetParam() + " --help"});
}

TEST_F(UsageTest, NumbersThatAreNoneAreRefused) {
  for (const char* const option : {"--threads", "--seed"}) {
    for (const char* const value : {"-1", "abc", "1.5", "0x10", "99999999999999999999"}) {
      expect_refusal({"align", "a.map", "b.map", option, value}, kWrongUsage,
                     {option, value, "expected"});
    }
  }
}

TEST_F(UsageTest, OnlyVerbsTakeThreadsAndASeedThatUseThem) {
  struct Use {
    Words verb;
    bool threads;
    bool seed;
  };
  for (const Use& use : {Use{{"align"}, true, true},
                         {{"demo"}, true, true},
                         {{"evaluate", "alignment"}, true, true},
                         {{"report"}, true, false},
                         {{"info"}, false, false},
                         {{"evaluate", "trajectory"}, false, false},
                         {{"evaluate", "map"}, false, false}}) {
    Words words = use.verb;
    words.push_back("--help");
    const std::string help = answer(words);
    for (const auto& [option, used] : {std::pair{"--threads", use.threads}, {"--seed", use.seed}}) {
      EXPECT_EQ(help.find(option) != std::string::npos, used) << use.verb.back() << " " << option;
      words.back() = option;
      words.push_back("1");
      if (!used) expect_refusal(words, kWrongUsage, {option, "--help"});
      words.pop_back();
    }
  }
}

TEST_F(UsageTest, UnknownVerbIsNamedBesideThoseThereAre) {
  expect_refusal({"alignn", "a", "b"}, kWrongUsage,
                 {"'alignn'", "demo, info, convert, align, evaluate, experiment, report"});
  expect_refusal({"--colour"}, kWrongUsage, {"'--colour'", "expected one of"});
}

TEST_F(UsageTest, WhatWasMeantIsSuggested) {
  expect_refusal({"aling", "a", "b"}, kWrongUsage, {"did you mean align?"});
  expect_refusal({"evaluate", "trajectroy", "a"}, kWrongUsage, {"did you mean trajectory?"});
  // Whatever else is missing: the option is the mistake.
  expect_refusal({"align", "a.map", "--intial", "x"}, kWrongUsage,
                 {"'--intial'", "did you mean --initial?"});
  expect_refusal({"align", "a.map", "b.map", "--min-probabilty=0.9"}, kWrongUsage,
                 {"did you mean --min-probability?"});
  EXPECT_THAT(cairn({"zzzzzzzz"}).errors, Not(HasSubstr("did you mean")));
}

TEST_F(UsageTest, HelpIsAVerbToo) {
  EXPECT_EQ(answer({"help"}), answer({"--help"}));
  EXPECT_EQ(answer({"help", "align"}), answer({"align", "--help"}));
  EXPECT_EQ(answer({"help", "evaluate", "map"}), answer({"evaluate", "map", "--help"}));
  expect_refusal({"help", "aling"}, kWrongUsage, {"did you mean align?"});
  EXPECT_EQ(answer({"-V"}), answer({"--version"}));
}

TEST_F(UsageTest, MissingArgumentIsNamed) {
  expect_refusal({"align"}, kWrongUsage, {"source"});
  expect_refusal({"align", "a.map"}, kWrongUsage, {"target"});
  expect_refusal({"convert", "a.map"}, kWrongUsage, {"output: not given; expected: Map to write"});
  expect_refusal({"info"}, kWrongUsage, {"map"});
  expect_refusal({"info", "a.map", "--json"}, kWrongUsage, {"--json"});
}

TEST_F(UsageTest, SurplusArgumentIsNamed) {
  expect_refusal({"align", "a.map", "b.map", "c.map"}, kWrongUsage, {"not expected: c.map"});
  expect_refusal({"align", "a.map", "b.map", "--threads", "-1"}, kWrongUsage,
                 {"--threads: '-1'; expected a whole number, 0 or more"});
}

TEST_F(UsageTest, UnquotedPoseIsExplained) {
  expect_refusal({"align", "a.map", "b.map", "--initial", "0.1", "-0.2", "0", "0", "0", "30"},
                 kWrongUsage, {"-0.2 0 0 0 30", "one quoted argument"});
}

// As of an unset shell variable.
TEST_F(UsageTest, EmptyValueIsRefused) {
  write_plain();
  expect_refusal({"info", ""}, kWrongUsage, {"map", "expected a value"});
  for (const char* const option :
       {"--initial", "--truth", "--confidence", "--camera", "--output"}) {
    expect_refusal({"align", "plain.map", "plain.map", option, ""}, kWrongUsage, {option});
  }
  expect_refusal({"convert", "plain.map", "out.map", "--frames", ""}, kWrongUsage, {"--frames"});
}

TEST_F(UsageTest, OptionIsNoValueOfTheOneBefore) {
  write_plain();
  expect_refusal({"info", "plain.map", "--json", "--quiet"}, kWrongUsage, {"--json", "--quiet"});
  EXPECT_THAT(files(), ::testing::ElementsAre("plain.map"));
}

TEST_F(UsageTest, PoseIsSixNumbers) {
  expect_refusal({"align", "a.map", "b.map", "--initial", "1 2 3"}, kWrongUsage,
                 {"--initial", "3 numbers", "x y z roll pitch yaw"});
  expect_refusal({"align", "a.map", "b.map", "--initial", "0 0 0 0 0 east"}, kWrongUsage,
                 {"--initial", "'east'"});
  expect_refusal({"align", "a.map", "b.map", "--initial", "0 0 0 0 0 nan"}, kWrongUsage, {"'nan'"});
  expect_refusal({"convert", "a.map", "b.map", "--transform", "1"}, kWrongUsage, {"--transform"});
  expect_refusal({"demo", "--displacement", "1 2"}, kWrongUsage, {"--displacement", "2 numbers"});
}

TEST_F(UsageTest, PosesBeyondTheLimitAreRefused) {
  expect_refusal({"align", "a.map", "b.map", "--initial", "1e308 0 0 0 0 0"}, kWrongUsage,
                 {"--initial", "is beyond the limit", "-1e9 to 1e9"});
  write("far.txt", "1 0 0 1e308  0 1 0 0  0 0 1 0  0 0 0 1\n");
  expect_refusal({"align", "a.map", "b.map", "--initial-matrix", "far.txt"}, kBadInput,
                 {"far.txt", "is beyond the limit"});
  write_plain();
  expect_refusal({"convert", "plain.map", "b.map", "--transform-matrix", "far.txt"}, kBadInput,
                 {"far.txt", "is beyond the limit"});
}

TEST_F(UsageTest, PoseAndPoseFileExcludeEachOther) {
  expect_refusal({"align", "a", "b", "--initial", "0 0 0 0 0 0", "--initial-matrix", "start.txt"},
                 kWrongUsage, {"--initial", "--initial-matrix"});
}

TEST_F(UsageTest, AlignmentOptionsOutOfRangeAreNamedAsTheUserKnowsThem) {
  const std::vector<std::pair<const char*, const char*>> wrong = {
      {"--neighbors", "0"},      {"--neighbors", "-1"},       {"--neighbors", "five"},
      {"--max-iterations", "0"}, {"--max-iterations", "1e3"}, {"--min-observations", "-1"},
      {"--trim", "1"},           {"--trim", "-0.1"},          {"--max-distance", "0"},
      {"--max-distance", "-1"},  {"--max-distance", "nan"},   {"--max-distance", "1e999"},
      {"--overlap-radius", "0"}, {"--overlap-radius", "inf"}};
  for (const auto& [option, value] : wrong) {
    expect_refusal({"align", "a.map", "b.map", option, value}, kWrongUsage,
                   {option, value, "expected"});
  }
}

TEST_F(UsageTest, UnknownMetricIsNamedBesideThoseThereAre) {
  expect_refusal({"align", "a.map", "b.map", "--confidence", "base,covarianec"}, kWrongUsage,
                 {"--confidence", "'covarianec'", "base, covariance", "did you mean covariance?"});
}

TEST_F(UsageTest, CamerasOfTheBenchmarkAndFilesAreKnownToEachVerb) {
  write_plain();
  write("own.yaml", "model: PINHOLE\nwidth: 640\nheight: 480\nparameters: [500, 500, 320, 240]\n");
  for (const char* const camera : {"fr1", "fr3", "own.yaml", "PINHOLE 640 480 500 500 320 240"}) {
    answer({"info", "plain.map", "--camera", camera});
    answer({"convert", "plain.map", "out.map", "--camera", camera});
    answer({"evaluate", "map", "plain.map", "--camera", camera});
    EXPECT_NE(cairn({"align", "plain.map", "plain.map", "--camera", camera}).exit_code,
              kWrongUsage);
  }
  expect_refusal({"info", "plain.map", "--camera", "fr4"}, kWrongUsage,
                 {"--camera", "'fr4'", "fr1, fr2 or fr3", "did you mean fr1?"});
  expect_refusal({"locate", "plain.map", "image.png", "--camera", "unknwon"}, kWrongUsage,
                 {"--camera", "did you mean unknown?"});
}

TEST_F(UsageTest, NothingInANameCommandsTheTerminal) {
  const std::string name = "desk\x1b]0;owned\x07\u202e.map";
  const CommandResult missing = cairn({"info", name});
  EXPECT_EQ(missing.exit_code, kBadInput);
  EXPECT_THAT(missing.errors, HasSubstr("desk\\x1b]0;owned\\x07\\xe2\\x80\\xae.map"));
  write(name, "FRAME 1 0 0 0 1 0 0 0\n");
  write("plain.map", "FRAME 1 0 0 0 1 0 0 0\n");
  const CommandResult there = cairn({"align", name, "plain.map"});
  for (const std::string& text : {missing.errors, there.output, there.errors}) {
    for (const char* const raw : {"\x1b", "\x07", "\u202e"}) {
      EXPECT_THAT(text, Not(HasSubstr(raw)));
    }
  }
}

TEST_F(UsageTest, DeeplyNestedJsonIsRefused) {
  const std::size_t depth = 200'000;
  const std::string deep = std::string(depth, '[') + std::string(depth, ']');
  write("deep.json", R"({"schema": {"name": )" + deep + R"(}, "results": )" + deep + "}");
  write_plain();
  std::filesystem::create_directory(path("experiment"));
  write("experiment/experiment.json", "{\"experiment\": " + deep + "}");
  write("experiment/runs.csv", "");
  for (const Words& words :
       {Words{"report", "deep.json", "-o", "r.html"}, Words{"report", "experiment", "-o", "r.html"},
        Words{"evaluate", "alignment", "deep.json", "--truth", "truth.txt"},
        Words{"align", "plain.map", "plain.map", "--initial-matrix", "deep.json"}}) {
    const CommandResult result = cairn(words);
    const bool has_no_viewer = result.errors.find("no viewer") != std::string::npos;
    if (has_no_viewer) continue;
    EXPECT_EQ(result.exit_code, kBadInput) << result.errors;
    EXPECT_THAT(result.errors, HasSubstr("nested too deeply"));
  }
}

TEST_F(UsageTest, CameraIsChecked) {
  expect_refusal({"info", "a.map", "--camera", "PINHOLE 640"}, kWrongUsage,
                 {"--camera", "MODEL width height parameters"});
  expect_refusal({"info", "a.map", "--camera", "FISH 640 480 1"}, kWrongUsage,
                 {"'FISH'", "PINHOLE"});
}

TEST_F(UsageTest, OutputOfUnknownFormatIsRefusedBeforeAnythingIsRead) {
  expect_refusal({"convert", "missing.map", "out.foo"}, kWrongUsage, {"out.foo", ".ply"});
  expect_refusal({"convert", "missing.map", "out"}, kWrongUsage, {"out", ".ply"});
  expect_refusal({"align", "missing.map", "b.map", "-o", "out.foo"}, kWrongUsage, {"out.foo"});
}

TEST_F(UsageTest, OutputOfSeveralStrategiesIsRefused) {
  expect_refusal({"align", "a.map", "b.map", "-o", "out.map", "--confidence", "none,distance"},
                 kWrongUsage, {"--output", "one --confidence"});
}

TEST_F(UsageTest, FrameRangeMustBeOne) {
  for (const char* const range : {"5:2", "5:5", "5:", ":5", "5", "a:b", "-5:5", "1:2:3", "1.5:2"}) {
    expect_refusal({"convert", "a.map", "b.map", "--frames", range}, kWrongUsage,
                   {"--frames", range, "A:B"});
  }
}

TEST_F(UsageTest, OptionsThatTheOutputFormatDoesNotHaveAreRefused) {
  expect_refusal({"convert", "a.map", "b.ply", "--format-version", "1"}, kWrongUsage,
                 {"--format-version", "b.ply"});
  expect_refusal({"convert", "a.map", "b.map", "--format-version", "4"}, kWrongUsage,
                 {"1, 2 or 3"});
  expect_refusal({"convert", "a.map", "b.map", "--ascii"}, kWrongUsage, {"--ascii", "b.map"});
}

TEST_F(UsageTest, MissingFolderOfAnOutputIsFoundBeforeTheWork) {
  expect_refusal({"align", "a.map", "b.map", "-o", "no/out.map"}, kSystemError,
                 {"no/out.map", "there is no folder no"});
  expect_refusal({"info", "a.map", "--json", "no/out.json"}, kSystemError, {"no/out.json"});
  expect_refusal({"convert", "a.map", "no/out.map"}, kSystemError, {"no/out.map"});
  expect_refusal({"info", "a.map", "--json", "."}, kSystemError, {"folder"});
}

// Inputs that lie in a folder, or that a list, a study or an earlier result names.
TEST_F(UsageTest, OutputThatIsAnInputNoWordNamesIsRefused) {
  write_pair(60);
  write("pairs.csv", "source,target\nsource.map,target.map\n");
  write("study.yaml",
        "name: s\npairs: [{name: a, source: source.map, target: target.map, truth: truth.txt}]\n"
        "initial_poses: {count: 2, yaw_deg: [-20, 20]}\n");
  const Words align = {"align", "source.map", "target.map", "--initial-matrix", "truth.txt"};
  Words saving = align;
  saving.insert(saving.end(), {"--no-verdict", "--json", "result.json"});
  answer(saving);
  answer({"convert", "source.map", "model/"});
  std::filesystem::create_directory(path("maps"));
  for (const char* const name : {"source.map", "target.map"}) {
    std::filesystem::copy_file(path(name), path("maps") / name);
  }
  std::filesystem::create_symlink("target.map", path("symlink"));
  std::filesystem::create_hard_link(path("target.map"), path("hard"));

  struct Case {
    Words words;
    const char* option;
    const char* output;
    const char* input;  // a name of the same file
  };
  std::vector<Case> cases = {
      {{"align", "--pairs", "pairs.csv"}, "--json", "target.map", "target.map"},
      {{"align", "--pairs", "pairs.csv"}, "--json", "symlink", "target.map"},
      {{"align", "--pairs", "pairs.csv"}, "--json", "hard", "target.map"},
      {{"experiment", "sweep", "study.yaml", "-o", "out"}, "--json", "source.map", "source.map"},
      {{"evaluate", "alignment", "result.json", "--truth", "truth.txt"},
       "--json",
       "source.map",
       "source.map"},
      {{"info", "model"}, "--json", "model/points3D.bin", "model/points3D.bin"},
  };
  if (report::has_viewer()) {
    cases.push_back({{"report", "result.json"}, "--output", "source.map", "source.map"});
  }
#ifdef CAIRN_HAS_MERGING
  cases.push_back(
      {{"merge", "maps", "-o", "merged.map"}, "--json", "maps/target.map", "maps/target.map"});
#endif
#ifdef CAIRN_HAS_ATLAS
  answer({"atlas", "init", "--atlas", "town.atlas"});
  cases.push_back({{"atlas", "add", "--atlas", "town.atlas", "maps"},
                   "--json",
                   "maps/source.map",
                   "maps/source.map"});
#endif
  for (const Case& one : cases) {
    const std::string before = content(one.output);
    Words words = one.words;
    words.insert(words.end(), {one.option, one.output});
    expect_refusal(words, kWrongUsage,
                   {one.option, std::string(one.input) + " is an input too", "a file of its own"});
    EXPECT_TRUE(content(one.output) == before) << one.words[0];
  }
}

TEST_F(UsageTest, UnreadableInputIsNamedWithTheReason) {
  write_plain();
  std::filesystem::create_directory(path("folder"));
  expect_refusal({"info", "missing.map"}, kBadInput, {"missing.map", "No such file"});
  expect_refusal({"info", "folder"}, kBadInput, {"folder", "is a folder, but no map"});
  expect_refusal({"align", "plain.map", "missing.map"}, kBadInput, {"missing.map"});
  expect_refusal({"align", "missing.map", "plain.map"}, kBadInput, {"missing.map"});
  expect_refusal({"convert", "missing.map", "out.map"}, kBadInput, {"missing.map"});
  EXPECT_FALSE(std::filesystem::exists(path("out.map")));
}

// Asking the operating system for the kind of such a file fails.
TEST_F(UsageTest, NameThatIsTooLongIsBadInput) {
  write_plain();
  const std::string name = std::string(300, 'n') + ".map";
  std::vector<Words> commands = {
      {"info", name},
      {"info", "plain.map", "--camera", name},
      {"align", name, "plain.map", "--json", "out.json"},
  };
  if (report::has_viewer()) commands.push_back({"report", name, "-o", "out.html"});
#ifdef CAIRN_HAS_ODOMETRY
  commands.push_back({"map", name, "--camera", "fr1", "-o", "out.map"});
#endif
#ifdef CAIRN_HAS_MERGING
  commands.push_back({"merge", name, "plain.map", "-o", "out.map"});
#endif
  for (const Words& words : commands) {
    SCOPED_TRACE(words[0]);
    expect_refusal(words, kBadInput, {name, "File name too long"});
  }
#ifdef CAIRN_HAS_SIMULATION
  expect_refusal({"simulate", name}, kSystemError, {name, "File name too long"});
#endif
}

TEST_F(UsageTest, BrokenMapIsRefusedByFileLineFieldAndValue) {
  write("broken.map", "FRAME 1 0 0 0 1 0 0 0\nFRAME 2 0 zero 0 1 0 0 0\n");
  expect_refusal({"info", "broken.map"}, kBadInput,
                 {"broken.map:2:", "field", "'zero'", "expected"});
  write("cut.map", "FRAME 1 0 0 0 1 0 0 0\nFRAME 2 0 0 0 1");
  expect_refusal({"info", "cut.map"}, kBadInput, {"cut.map:2:"});
  write("picture.png", "\x89PNG\r\n\x1a\n");
  expect_refusal({"info", "picture.png"}, kBadInput, {"picture.png: is an image", "cairn locate"});
  write("empty.map", "");
  expect_refusal({"info", "empty.map"}, kBadInput, {"empty.map", "empty"});
}

TEST_F(UsageTest, WhatIsNoImageOrNoCameraIsNamed) {
  write_plain();
  write("walk.mp4", std::string("\0\0\0\x18"
                                "ftypmp42",
                                12));
  expect_refusal({"map", "walk.mp4", "-o", "walk.map"}, kBadInput,
                 {"walk.mp4: is a video", "RGB-D and stereo images only"});
  expect_refusal({"info", "a.map", "--camera", "517,516,318,255"}, kWrongUsage,
                 {"--camera", "without model and image size", "PINHOLE 640 480"});
}

TEST_F(UsageTest, PoseFilesAreChecked) {
  write_plain();
  const std::vector<std::pair<const char*, const char*>> wrong = {
      {"1 2 3", "3 numbers"},
      {"", "0 numbers"},
      {"1 0 0 0 0 1 0 0 0 0 2 0 0 0 0 1", "rotation"},
      {"1 0 0 0 0 1 0 0 0 0 one 0 0 0 0 1", "'one'"},
      {"{", "JSON"},
      {R"({"results": []})", "at least one"},
      {R"({"results": [{"target_from_source": null}]})", "no pose"},
      {R"({"results": [{"target_from_source": [[1, 2], [3]]}]})", "4 rows"}};
  for (const auto& [text, fragment] : wrong) {
    write("pose", text);
    expect_refusal({"align", "plain.map", "plain.map", "--truth", "pose"}, kBadInput,
                   {"pose: ", fragment});
    expect_refusal({"align", "plain.map", "plain.map", "--initial-matrix", "pose"}, kBadInput,
                   {"pose: ", fragment});
  }
  expect_refusal({"align", "plain.map", "plain.map", "--truth", "plain.map"}, kBadInput,
                 {"plain.map", "16 numbers"});
}

}  // namespace
}  // namespace cairn::testing
