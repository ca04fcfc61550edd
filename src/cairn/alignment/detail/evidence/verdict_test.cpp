// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/detail/evidence/verdict.hpp"

#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/alignment/alignment.hpp"

namespace cairn::detail {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

RegistrationResult known_pose() {
  RegistrationResult result;
  result.covariance = Matrix6d(Matrix6d::Identity());
  return result;
}

Judgement verdict_of(const std::vector<PlacementCandidate>& candidates,
                     const RegistrationResult& result = known_pose()) {
  return judge(candidates, result, 3000);
}

// @param support share of the 3000 landmarks that match, all of them closely
PlacementCandidate judged_candidate(double probability, double support = 0.4) {
  PlacementCandidate result{.target_from_source = {},
                            .support = {.share = support, .spread_evidence = 2000.0 * support},
                            .contradicted = 0.015,
                            .probability = probability};
  result.support.within.fill(static_cast<std::size_t>(3000.0 * support));
  return result;
}

TEST(Verdict, AlignedIfTheBestIsRightBeyondDoubt) {
  const Judgement judgement = verdict_of({judged_candidate(0.996), judged_candidate(0.001, 0.15)});
  EXPECT_EQ(judgement.verdict, Verdict::kAligned);
  EXPECT_THAT(judgement.reason, HasSubstr("40.0 %"));
  EXPECT_THAT(judgement.reason, HasSubstr("15.0 %"));
  EXPECT_THAT(judgement.reason, HasSubstr("1.5 %"));
  EXPECT_THAT(judgement.reason, HasSubstr("99.60 %"));
  EXPECT_THAT(judgement.reason, HasSubstr("3000"));
}

TEST(Verdict, AmbiguousIfTheLandmarksMatchAsWellAtAnotherPoseHoweverUnlikelyThat) {
  const auto with = [](const auto& change) {
    PlacementCandidate other = judged_candidate(0.001, 0.39);
    change(other);
    return verdict_of({judged_candidate(0.996), other});
  };
  const Judgement judgement = with([](PlacementCandidate&) {});
  EXPECT_EQ(judgement.verdict, Verdict::kAmbiguous);
  EXPECT_THAT(judgement.reason, StartsWith("the landmarks match as well at 1 other pose"));
  EXPECT_THAT(verdict_of({judged_candidate(0.996), judged_candidate(0.001, 0.38),
                          judged_candidate(0.001, 0.5)})
                  .reason,
              StartsWith("the landmarks match as well at 2 other poses"));
  EXPECT_THAT(verdict_of({judged_candidate(0.996), judged_candidate(0.001, 0.1),
                          judged_candidate(0.001, 0.5)})
                  .reason,
              StartsWith("the landmarks match as well at 1 other pose"));
  // Half as well is as well.
  EXPECT_EQ(verdict_of({judged_candidate(0.996), judged_candidate(0.001, 0.2)}).verdict,
            Verdict::kAmbiguous);
  EXPECT_EQ(verdict_of({judged_candidate(0.996), judged_candidate(0.001, 0.19)}).verdict,
            Verdict::kAligned);
  // One kind of evidence that tells them apart is enough.
  using Other = PlacementCandidate;
  EXPECT_EQ(with([](Other& other) { other.support.within[2] = 599; }).verdict, Verdict::kAligned);
  EXPECT_EQ(with([](Other& other) { other.support.within[5] = 599; }).verdict, Verdict::kAligned);
  EXPECT_EQ(with([](Other& other) { other.support.spread_evidence = 399.0; }).verdict,
            Verdict::kAligned);
  EXPECT_EQ(with([](Other& other) { other.contradicted = 0.2; }).verdict, Verdict::kAligned);
  // Landmarks that match roughly only tell nothing.
  EXPECT_EQ(with([](Other& other) { other.support.within[1] = 0; }).verdict, Verdict::kAmbiguous);
  EXPECT_EQ(with([](Other& other) { other.contradicted = 0.1; }).verdict, Verdict::kAmbiguous);
  EXPECT_EQ(with([](Other& other) { other.contradicted.reset(); }).verdict, Verdict::kAmbiguous);
}

TEST(Verdict, BelievesLooksThatTellPosesApartAtWhichLandmarksMatchAsWell) {
  PlacementCandidate best = judged_candidate(0.996);
  best.support.agreement = DescriptorAgreement{200, 50, 40, 1.25};
  PlacementCandidate other = judged_candidate(0.001);
  other.support.agreement = DescriptorAgreement{200, 2, 2, 1.25};
  EXPECT_EQ(verdict_of({best, other}).verdict, Verdict::kAligned);
  best.support.agreement = other.support.agreement;
  EXPECT_EQ(verdict_of({best, other}).verdict, Verdict::kAmbiguous);
  best.support.spread_likeness = 1000.0;
  EXPECT_EQ(verdict_of({best, other}).verdict, Verdict::kAligned);
}

TEST(Verdict, AmbiguousIfDescriptorsInSeveralSpotsAgreeWithAnotherPose) {
  const auto with = [](std::size_t best_spread, std::size_t other_agreeing,
                       std::size_t other_spread) {
    std::vector candidates = {judged_candidate(0.996), judged_candidate(0.001, 0.1)};
    candidates[0].support.agreement =
        DescriptorAgreement{.matches = 87, .agreeing = 29, .spread = best_spread, .expected = 0.3};
    candidates[1].support.agreement = DescriptorAgreement{
        .matches = 87, .agreeing = other_agreeing, .spread = other_spread, .expected = 0.3};
    return verdict_of(candidates);
  };
  const Judgement judgement = with(16, 20, 9);
  EXPECT_EQ(judgement.verdict, Verdict::kAmbiguous);
  EXPECT_THAT(judgement.reason,
              StartsWith("20 descriptor matches agree with another pose, 29 with the best"));
  EXPECT_EQ(with(15, 10, 5).verdict, Verdict::kAmbiguous);
  EXPECT_EQ(with(16, 10, 5).verdict, Verdict::kAligned);
  // One thing that moved, and chance.
  EXPECT_EQ(with(16, 20, 1).verdict, Verdict::kAligned);
  EXPECT_EQ(with(4, 4, 4).verdict, Verdict::kAligned);
}

TEST(Verdict, SaysHowManyMatchesLookAlikeWhereThatIsKnown) {
  PlacementCandidate best = judged_candidate(0.996);
  EXPECT_THAT(verdict_of({best}).reason, Not(HasSubstr("similar")));
  best.support.likeness = Likeness{200, 50};
  EXPECT_THAT(
      verdict_of({best}).reason,
      HasSubstr("25.0 % of the matches have similar descriptors (1.6 % expected by chance)"));
  best.support.likeness = Likeness{1, 1};
  EXPECT_THAT(verdict_of({best}).reason,
              HasSubstr("100.0 % of the matches have similar descriptors"));
  best.support.likeness = Likeness{0, 0};
  EXPECT_THAT(verdict_of({best}).reason, Not(HasSubstr("similar")));
}

TEST(Verdict, AmbiguousIfOneOfSeveralIsRightBeyondDoubt) {
  const Judgement judgement = verdict_of({judged_candidate(0.4), judged_candidate(0.35),
                                          judged_candidate(0.24), judged_candidate(0.005)});
  EXPECT_EQ(judgement.verdict, Verdict::kAmbiguous);
  EXPECT_THAT(judgement.reason, HasSubstr("3 poses"));
}

TEST(Verdict, CountsAsRivalsThosePosesThatAreATwentiethAsLikely) {
  const Judgement judgement = verdict_of({judged_candidate(0.5), judged_candidate(0.44),
                                          judged_candidate(0.028), judged_candidate(0.024)});
  EXPECT_EQ(judgement.verdict, Verdict::kAmbiguous);
  EXPECT_THAT(judgement.reason, HasSubstr("3 poses"));
}

TEST(Verdict, TakesTheLeastProbabilityItself) {
  const std::vector<PlacementCandidate> one = {judged_candidate(0.75)};
  EXPECT_EQ(judge(one, known_pose(), 3000, 0.75).verdict, Verdict::kAligned);
  EXPECT_EQ(judge(one, known_pose(), 3000, 0.7501).verdict, Verdict::kRejected);
  const std::vector<PlacementCandidate> two = {judged_candidate(0.5), judged_candidate(0.25)};
  EXPECT_EQ(judge(two, known_pose(), 3000, 0.75).verdict, Verdict::kAmbiguous);
}

TEST(Verdict, SaysWhetherThereIsAnotherPose) {
  EXPECT_THAT(verdict_of({judged_candidate(1.0)}).reason, HasSubstr("no other pose was found"));
  EXPECT_THAT(verdict_of({judged_candidate(0.996), judged_candidate(0.001, 0.15)}).reason,
              HasSubstr("the next pose 15.0 %"));
}

TEST(Verdict, SaysThatAnotherPoseMatchesMoreButLessClosely) {
  PlacementCandidate best = judged_candidate(0.996);
  PlacementCandidate next = judged_candidate(0.001, 0.15);
  best.support.within = {270, 240, 200, 90, 30, 9};
  next.support.within = {370, 190, 60, 20, 4, 0};
  next.support.share = best.support.share + 0.1;
  EXPECT_THAT(verdict_of({best, next}).reason,
              HasSubstr(" % (but 60 within a quarter of the radius, the best pose 200)"));
  next.support.share = best.support.share;
  EXPECT_THAT(verdict_of({best, next}).reason, Not(HasSubstr("a quarter of the radius")));
}

TEST(Verdict, RejectedIfPerhapsNoneIsRight) {
  EXPECT_EQ(verdict_of({judged_candidate(0.9), judged_candidate(0.03)}).verdict,
            Verdict::kRejected);
  EXPECT_EQ(verdict_of({judged_candidate(1e-7)}).verdict, Verdict::kRejected);
  EXPECT_EQ(verdict_of({}).verdict, Verdict::kRejected);
}

TEST(Verdict, AmbiguousByNameIfADirectionIsOpenHoweverLikelyThePose) {
  RegistrationResult result = known_pose();
  result.unobservable.push_back({{0.0, 2.0, 0.0}, Eigen::Vector3d::Zero(), 0.0});
  const Judgement shift = verdict_of({judged_candidate(1.0)}, result);
  EXPECT_EQ(shift.verdict, Verdict::kAmbiguous);
  EXPECT_THAT(shift.reason, HasSubstr("the shift along (0.00, 1.00, 0.00)"));
  result.unobservable = {{Eigen::Vector3d::Zero(), {0.0, 0.0, 1.0}, 0.0}};
  EXPECT_THAT(verdict_of({judged_candidate(1.0)}, result).reason,
              HasSubstr("the turn about (0.00, 0.00, 1.00)"));
  result.unobservable = {{Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(), 1.0}};
  EXPECT_THAT(verdict_of({judged_candidate(1.0)}, result).reason, HasSubstr("the scale"));
}

TEST(Verdict, NamesAnOpenDirectionAfterItsLargestPart) {
  const auto reason = [](std::vector<OpenDirection> open) {
    RegistrationResult result = known_pose();
    result.unobservable = std::move(open);
    return verdict_of({judged_candidate(1.0)}, result).reason;
  };
  EXPECT_THAT(reason({{{0.9, 0.0, 0.0}, {0.0, 0.5, 0.0}, -1.0}}), HasSubstr("determine the scale"));
  EXPECT_THAT(reason({{{0.9, 0.0, 0.0}, {0.0, 0.5, 0.0}, 0.7}}),
              HasSubstr("the shift along (1.00, 0.00, 0.00)"));
  EXPECT_THAT(reason({{{0.5, 0.0, 0.0}, {0.0, 0.9, 0.0}, 0.7}}),
              HasSubstr("the turn about (0.00, 1.00, 0.00)"));
  EXPECT_THAT(reason({{{0.0, 0.0, 2.0}, {2.0, 0.0, 0.0}, 0.0}}), HasSubstr("the shift"));
  EXPECT_THAT(
      reason({{{0.0, 0.0, -3.0}, {0.0, 0.0, 0.0}, 0.0}, {{0, 0, 0}, {0, -2.0, 0}, 0.0}}),
      HasSubstr("the shift along (0.00, 0.00, -1.00) and the turn about (0.00, -1.00, 0.00)"));
}

TEST(Verdict, AmbiguousWithoutACovariance) {
  const Judgement judgement = verdict_of({judged_candidate(1.0)}, RegistrationResult{});
  EXPECT_EQ(judgement.verdict, Verdict::kAmbiguous);
  EXPECT_THAT(judgement.reason, HasSubstr("too few places"));
}

TEST(Verdict, SaysHowManyDescriptorMatchesAgreeWhereThatIsKnown) {
  PlacementCandidate best = judged_candidate(0.996);
  EXPECT_THAT(verdict_of({best}).reason, Not(HasSubstr("descriptor")));
  best.support.agreement = DescriptorAgreement{0, 0, 0, 0.0};
  EXPECT_THAT(verdict_of({best}).reason, Not(HasSubstr("descriptor")));
  best.support.agreement = DescriptorAgreement{1, 1, 1, 0.5};
  EXPECT_THAT(verdict_of({best}).reason, HasSubstr("1 of 1 descriptor matches"));
  best.support.agreement = DescriptorAgreement{200, 50, 40, 1.25};
  EXPECT_THAT(verdict_of({best}).reason,
              HasSubstr("50 of 200 descriptor matches agree with it (1.2 expected by chance)"));
}

TEST(Verdict, ReasonLeadsWithTheDecisionAndItsNumber) {
  EXPECT_THAT(verdict_of({judged_candidate(0.996)}).reason,
              StartsWith("probability 99.60 %, at least the required 99 %: "));
  EXPECT_THAT(verdict_of({judged_candidate(0.123)}).reason,
              StartsWith("probability 12.30 %, below the required 99 %: "));
  EXPECT_THAT(judge({{judged_candidate(0.6)}}, known_pose(), 3000, 0.995).reason,
              StartsWith("probability 60.00 %, below the required 99.5 %: "));
  EXPECT_THAT(verdict_of({judged_candidate(0.5), judged_candidate(0.495)}).reason,
              StartsWith("2 poses fit about equally well; probability 50.00 %, below the "
                         "required 99 %: "));
  EXPECT_THAT(verdict_of({judged_candidate(0.996)}, RegistrationResult{}).reason,
              StartsWith("the matches lie in too few places to compute a covariance; probability "
                         "99.60 %, at least the required 99 %: "));
}

TEST(ProbabilityText, IsNeverRoundedUpToTheBarToZeroOrToOne) {
  EXPECT_EQ(probability_text(0.0), "<0.01 %");
  EXPECT_EQ(probability_text(0.00009), "<0.01 %");
  EXPECT_EQ(probability_text(0.00102), "0.10 %");
  EXPECT_EQ(probability_text(0.9983), "99.83 %");
  EXPECT_EQ(probability_text(0.98999), "98.99 %");
  EXPECT_EQ(probability_text(0.99), "99.00 %");
  EXPECT_EQ(probability_text(0.99996), "99.9960 %");
  EXPECT_EQ(probability_text(0.9999991), ">99.9999 %");
  EXPECT_EQ(probability_text(1.0), ">99.9999 %");
}

TEST(Verdict, IsNamedInResults) {
  EXPECT_EQ(to_string(Verdict::kAligned), "aligned");
  EXPECT_EQ(to_string(Verdict::kAmbiguous), "ambiguous");
  EXPECT_EQ(to_string(Verdict::kRejected), "rejected");
}

TEST(Verdict, NeverSaysThatAPoseIsCertain) {
  EXPECT_THAT(verdict_of({judged_candidate(1.0)}).reason, HasSubstr(">99.9999 %"));
  EXPECT_THAT(verdict_of({judged_candidate(0.0)}).reason, HasSubstr("<0.01 %"));
}

Judgement judgement_with(const Surroundings& around) {
  const std::vector<PlacementCandidate> one = {judged_candidate(0.9999)};
  return judge(one, known_pose(), 3000, 0.99, around);
}

TEST(Verdict, AmbiguousIfSurroundingsDoNotAgree) {
  const Judgement judgement =
      judgement_with({{.agree = 300, .in_front = 100, .behind = 600}, 30.0});
  EXPECT_EQ(judgement.verdict, Verdict::kAmbiguous);
  EXPECT_THAT(judgement.reason,
              HasSubstr("around the matches, 30.0 % of 1000 landmarks are at the depth that the "
                        "other map's cameras saw, below the required 40 %"));
  for (const double extent : {3.0, 30.0}) {
    const auto with = [&](const SightCounts& landmarks) {
      return judgement_with({landmarks, extent}).verdict;
    };
    EXPECT_EQ(with({.agree = 40, .in_front = 60}), Verdict::kAligned);
    EXPECT_EQ(with({.agree = 39, .in_front = 61}), Verdict::kAmbiguous);
    EXPECT_EQ(with({.agree = 39, .in_front = 5, .behind = 56}), Verdict::kAmbiguous);
  }
}

TEST(Verdict, SurroundingsOfALargePlaceMayHideEachOther) {
  const SightCounts hidden = {.agree = 90, .in_front = 10, .behind = 900};
  EXPECT_EQ(judgement_with({hidden, 17.6}).verdict, Verdict::kAligned);
  EXPECT_EQ(judgement_with({hidden, 17.4}).verdict, Verdict::kAmbiguous);
  EXPECT_EQ(judgement_with({{.agree = 89, .in_front = 11, .behind = 900}, 17.6}).verdict,
            Verdict::kAmbiguous);
  EXPECT_EQ(judgement_with({{.agree = 7, .behind = 93}, 17.6}).verdict, Verdict::kAligned);
  EXPECT_EQ(judgement_with({{.agree = 6, .behind = 94}, 17.6}).verdict, Verdict::kAmbiguous);
}

TEST(Verdict, MatchesOfOneSpotNeedSurroundings) {
  const SightCounts few = {.agree = 10, .behind = 1};
  EXPECT_EQ(judgement_with({few, 17.6, 0.5}).verdict, Verdict::kAligned);
  EXPECT_EQ(judgement_with({{.in_front = 11}, 17.6, 0.5}).verdict, Verdict::kAligned);
  const Judgement spot = judgement_with({few, 17.4, 0.5});
  EXPECT_EQ(spot.verdict, Verdict::kAmbiguous);
  EXPECT_THAT(
      spot.reason,
      HasSubstr("all matches are in a ball of 17.4 matching radii, below the "
                "required 17.5, and cameras of one map looked at 11 landmarks of the other around "
                "it, fewer than 12"));
  EXPECT_THAT(judgement_with({{}, 17.4, 0.5}).reason,
              HasSubstr("and no camera shows what is around it in either map"));
  EXPECT_EQ(judgement_with({{.agree = 4}, 17.4, 0.5}).verdict, Verdict::kAligned);
  EXPECT_EQ(judgement_with({{.agree = 3}, 17.4, 0.5}).verdict, Verdict::kAmbiguous);
  EXPECT_EQ(judgement_with({few, 17.4, 0.19}).verdict, Verdict::kAligned);
  EXPECT_EQ(judgement_with({{.agree = 12}, 17.4, 0.5}).verdict, Verdict::kAligned);
}

TEST(Verdict, MatchesOfOneSpotNeedDescriptorsThatAgreeElsewhereOrFreeLinesOfSight) {
  const auto with = [](std::size_t spread, double extent, std::optional<double> contradicted) {
    PlacementCandidate candidate = judged_candidate(0.9999);
    candidate.support.agreement =
        DescriptorAgreement{.matches = 100, .agreeing = 90, .spread = spread};
    candidate.contradicted = contradicted;
    // A wall on which a thing stands twice agrees in all.
    return judge(std::vector{candidate}, known_pose(), 3000, 0.99, {{.agree = 300}, extent, 0.5});
  };
  EXPECT_EQ(with(20, 17.4, 0.05).verdict, Verdict::kAligned);
  EXPECT_EQ(with(19, 17.4, 0.05).verdict, Verdict::kAmbiguous);
  EXPECT_THAT(
      with(19, 17.4, 0.05).reason,
      HasSubstr("all matches are in a ball of 17.4 matching radii, below the required 17.5, "
                "19 descriptor matches outside their largest cluster agree, fewer than 20, "
                "and 5.0 % of the lines of sight contradict it"));
  EXPECT_EQ(with(19, 17.6, 0.05).verdict, Verdict::kAligned);
  EXPECT_EQ(with(19, 17.4, 0.03).verdict, Verdict::kAligned);
  EXPECT_EQ(with(19, 17.4, 0.031).verdict, Verdict::kAmbiguous);
  EXPECT_EQ(with(19, 17.4, std::nullopt).verdict, Verdict::kAmbiguous);
}

TEST(Verdict, AmbiguousIfHardlyAnythingThatBothMapsSawAlikeLooksTheSame) {
  const auto with = [](std::size_t seen, std::size_t distinctive, std::size_t agreeing,
                       std::size_t identical = 0) {
    PlacementCandidate best = judged_candidate(0.996);
    best.support.agreement = DescriptorAgreement{.matches = 200,
                                                 .agreeing = agreeing + 5,
                                                 .spread = agreeing,
                                                 .expected = 1.0,
                                                 .identities = identical,
                                                 .identical = identical};
    return judge(std::vector{best}, known_pose(), 3000, 0.99,
                 {.seen_alike = {.landmarks = seen, .distinctive = distinctive}});
  };
  const Judgement judgement = with(400, 19, 79);
  EXPECT_EQ(judgement.verdict, Verdict::kAmbiguous);
  EXPECT_THAT(judgement.reason, StartsWith("the maps may show two places that are built alike: of "
                                           "400 landmarks"));
  EXPECT_EQ(with(400, 20, 79).verdict, Verdict::kAligned);
  EXPECT_EQ(with(400, 19, 80).verdict, Verdict::kAligned);
  // Too few to tell.
  EXPECT_EQ(with(40, 0, 3).verdict, Verdict::kAmbiguous);
  EXPECT_EQ(with(39, 0, 3).verdict, Verdict::kAligned);
  // The descriptors of two programs cannot be compared.
  EXPECT_EQ(with(400, 0, 2).verdict, Verdict::kAligned);
  // Common images prove what looks cannot.
  EXPECT_EQ(with(400, 0, 10, 10).verdict, Verdict::kAligned);
}

}  // namespace
}  // namespace cairn::detail
