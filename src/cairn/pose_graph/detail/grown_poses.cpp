// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/pose_graph/detail/grown_poses.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <queue>
#include <set>
#include <tuple>
#include <utility>

namespace cairn::detail {
namespace {

// Number of edges between two groups that propose a relative pose; the others only vote.
constexpr std::size_t kProposers = 64;
// Proposals that are kept for a pair of groups.
constexpr std::size_t kKept = 3;
// Largest error of an edge, in standard deviations.
constexpr double kToleratedDeviations = 3.0;
// Half of the largest rotation angle, π.
constexpr double kRight = 1.5707963267948966;
// Groups from this size on are refined.
constexpr std::size_t kSmallestRefined = 8;

// A proposed relative pose of two groups.
struct Proposal {
  std::size_t edge = 0;
  Similarity3 first_from_second;
  std::size_t votes = 0;
  double uncertainty = 0.0;
};

struct Between {
  std::vector<std::size_t> edges;
  std::vector<Proposal> proposals;  // most votes first
  std::size_t asked = 0;            // number of edges when the proposals were made
  std::size_t stamp = 0;            // of the newest entry in the queue

  // Whether new edges may change the proposals. If there are many, a few more do not.
  bool is_to_be_asked() const {
    constexpr std::size_t kFew = 256;
    return edges.size() <= kFew || edges.size() > asked + asked / 8;
  }
};

// How a node is joined to its group: the end nearer to the group's first node of the edge that joined two groups.
struct Joint {
  std::size_t to = kNoIndex;
  std::size_t edge = kNoIndex;
};

// Standard deviations of an edge: translation of the source's centre, rotation and log scale.
struct Deviations {
  double shift = 0.0;
  double turn = 0.0;
  double growth = 0.0;
};

Deviations deviations_of(const PoseEdge& edge, std::span<const NodeExtent> extents) {
  const Matrix7d& c = edge.covariance;
  return {std::sqrt(mean_square_shift(c, edge.target_from_source, extents[edge.source])),
          std::sqrt(c(3, 3) + c(4, 4) + c(5, 5)), std::sqrt(c(6, 6))};
}

struct Entry {
  std::size_t score = 0;
  double uncertainty = 0.0;
  std::size_t first = 0;
  std::size_t second = 0;
  std::size_t stamp = 0;

  // Lower priority.
  bool operator<(const Entry& other) const {
    return std::tuple(score, -uncertainty, -static_cast<double>(first),
                      -static_cast<double>(second)) <
           std::tuple(other.score, -other.uncertainty, -static_cast<double>(other.first),
                      -static_cast<double>(other.second));
  }
};

class Growth {
 public:
  Growth(std::span<const PoseEdge> edges, std::span<const NodeExtent> extents,
         std::span<const std::size_t> runs, double agreement,
         const std::function<void(PoseGroup& group)>& refine,
         std::span<const std::optional<Similarity3>> placed)
      : edges_(edges),
        extents_(extents),
        runs_(runs),
        agreement_(agreement),
        refine_(refine),
        group_of_(extents.size()),
        pose_(extents.size()),
        members_(extents.size()),
        joints_(extents.size()),
        refined_(extents.size(), kSmallestRefined / 2),
        neighbours_(extents.size()),
        beside_(extents.size()) {
    std::iota(group_of_.begin(), group_of_.end(), std::size_t{0});
    for (std::size_t i = 0; i < members_.size(); ++i) members_[i] = {i};
    begin_with(placed);
    for (std::size_t i = 0; i < edges_.size(); ++i) {
      deviations_.push_back(deviations_of(edges_[i], extents_));
      const auto [a, b] = std::minmax(group_of_[edges_[i].target], group_of_[edges_[i].source]);
      if (a != b) neighbours_[a][b].edges.push_back(i);
    }
    for (std::size_t a = 0; a < neighbours_.size(); ++a) {
      for (auto& [b, between] : neighbours_[a]) {
        beside_[a].push_back(b);
        beside_[b].push_back(a);
        propose(a, between);
      }
    }
  }

  std::vector<PoseGroup> run() {
    grow();
    within_runs_ = false;
    grow();
    std::vector<PoseGroup> groups;
    for (std::size_t i = 0; i < members_.size(); ++i) {
      if (!members_[i].empty()) groups.push_back(group(i));
    }
    std::stable_sort(groups.begin(), groups.end(), [](const PoseGroup& a, const PoseGroup& b) {
      return std::tuple(b.nodes.size(), a.nodes.front()) <
             std::tuple(a.nodes.size(), b.nodes.front());
    });
    return groups;
  }

 private:
  // Nodes that were placed before are one group.
  void begin_with(std::span<const std::optional<Similarity3>> placed) {
    for (std::size_t i = 0; i < placed.size(); ++i) {
      if (!placed[i]) continue;
      if (placed_group_ == kNoIndex) placed_group_ = i;
      pose_[i] = *placed[i];
      placed_runs_.insert(runs_[i]);
      if (i == placed_group_) continue;
      group_of_[i] = placed_group_;
      members_[placed_group_].push_back(i);
      members_[i].clear();
    }
    if (placed_group_ != kNoIndex) refined_[placed_group_] = members_[placed_group_].size();
  }

  // Whether two groups are of one run. A group is named after one of its nodes; until runs are joined, it has
  // nodes of one run, apart from the group that was placed before.
  bool share_a_run(std::size_t first, std::size_t second) const {
    if (first == placed_group_) return placed_runs_.contains(runs_[second]);
    if (second == placed_group_) return placed_runs_.contains(runs_[first]);
    return runs_[first] == runs_[second];
  }

  void grow() {
    // Reconsiders undecided pairs, because the support by third groups changes as these grow.
    for (bool grew = true; grew;) {
      grew = false;
      for (std::size_t a = 0; a < neighbours_.size(); ++a) {
        for (auto& [b, between] : neighbours_[a]) enqueue(a, b, between);
      }
      while (!queue_.empty()) {
        const Entry entry = queue_.top();
        queue_.pop();
        const auto found = neighbours_[entry.first].find(entry.second);
        if (found == neighbours_[entry.first].end() || found->second.stamp != entry.stamp) continue;
        join(entry.first, entry.second);
        grew = true;
      }
    }
  }

  Between* between(std::size_t a, std::size_t b) {
    const auto [low, high] = std::minmax(a, b);
    const auto found = neighbours_[low].find(high);
    return found == neighbours_[low].end() ? nullptr : &found->second;
  }

  // The relative pose of two groups according to one edge.
  struct Opinion {
    std::size_t edge = 0;
    std::size_t node = 0;  // its end in the second group
    Similarity3 first_from_second;
    Similarity3 first_from_node;
    Eigen::Vector3d in_second;  // centre of that node
    Eigen::Vector3d in_first;
    // Parts of first_from_second, for comparisons.
    Eigen::Matrix3d linear;
    Eigen::Vector4d quaternion;
    double log_scale = 0.0;
    double uncertainty = 0.0;  // of the edge, in radii and radians
  };

  Opinion opinion(std::size_t edge, std::size_t first) const {
    const PoseEdge& e = edges_[edge];
    const bool forward = group_of_[e.target] == first;
    Opinion result;
    result.edge = edge;
    result.node = forward ? e.source : e.target;
    result.first_from_node = forward ? pose_[e.target] * e.target_from_source
                                     : pose_[e.source] * e.target_from_source.inverse();
    result.first_from_second = result.first_from_node * pose_[result.node].inverse();
    result.in_second = pose_[result.node] * extents_[result.node].centre;
    result.in_first = result.first_from_node * extents_[result.node].centre;
    result.linear = result.first_from_second.linear();
    result.quaternion = result.first_from_second.rigid().quaternion().coeffs();
    result.log_scale = std::log(result.first_from_second.scale());
    const Deviations& deviations = deviations_[edge];
    result.uncertainty =
        std::hypot(deviations.shift / extents_[result.node].radius, deviations.turn);
    return result;
  }

  // Whether two edges give the other's node the same pose, within their uncertainties and the given ones.
  bool agree(const Opinion& one, const Opinion& other, const Deviations& further = {}) const {
    const Deviations& mine = deviations_[one.edge];
    const Deviations& its = deviations_[other.edge];
    const auto square = [](double x) { return x * x; };
    const double scale = std::max(one.first_from_node.scale(), other.first_from_node.scale());
    const double variance =
        square(scale) * (square(mine.shift) + square(its.shift)) +
        (one.in_first - other.in_first).squaredNorm() * (square(mine.turn) + square(mine.growth));
    const double shift = agreement_ * other.first_from_node.scale() * extents_[other.node].radius +
                         kToleratedDeviations * std::sqrt(variance + square(further.shift));
    const Eigen::Vector3d said = one.linear * other.in_second + one.first_from_second.translation();
    if ((said - other.in_first).squaredNorm() > square(shift)) return false;
    if (std::abs(one.log_scale - other.log_scale) >
        agreement_ + kToleratedDeviations * std::hypot(mine.growth, its.growth, further.growth)) {
      return false;
    }
    const double cosine =
        std::abs(one.quaternion.dot(other.quaternion));  // of half the rotation between them
    if (cosine >= least_cosine_) return true;
    const double turn =
        agreement_ + kToleratedDeviations * std::hypot(mine.turn, its.turn, further.turn);
    return cosine >= std::cos(std::min(0.5 * turn, kRight));
  }

  // Adds to `variance` that of the pose of one node relative to another of its group, for a point at `point` in
  // the group's frame: of the joints between them.
  void add_drift(std::size_t one, std::size_t other, const Eigen::Vector3d& point,
                 double group_scale, Deviations& variance) const {
    std::vector<std::size_t> above;  // `one` and what it is joined to, up to the group's first node
    for (std::size_t node = one; node != kNoIndex; node = joints_[node].to) above.push_back(node);
    std::size_t meeting = other;
    while (meeting != kNoIndex && std::find(above.begin(), above.end(), meeting) == above.end()) {
      meeting = joints_[meeting].to;
    }
    const auto square = [](double x) { return x * x; };
    for (const std::size_t end : {one, other}) {
      for (std::size_t node = end; node != meeting && joints_[node].to != kNoIndex;
           node = joints_[node].to) {
        const Deviations& joint = deviations_[joints_[node].edge];
        const std::size_t target = edges_[joints_[node].edge].target;
        const double away = (pose_[node] * extents_[node].centre - point).squaredNorm();
        variance.shift +=
            square(group_scale) * (square(pose_[target].scale() * joint.shift) +
                                   away * (square(joint.turn) + square(joint.growth)));
        variance.turn += square(joint.turn);
        variance.growth += square(joint.growth);
      }
    }
  }

  // How far two edges may disagree because both groups drift between the edges' ends.
  Deviations drift(const Opinion& one, const Opinion& other) const {
    const auto end_in_first = [&](const Opinion& opinion) {
      const PoseEdge& edge = edges_[opinion.edge];
      return opinion.node == edge.source ? edge.target : edge.source;
    };
    Deviations sum;
    add_drift(end_in_first(one), end_in_first(other), other.in_first, 1.0, sum);
    add_drift(one.node, other.node, other.in_second, one.first_from_second.scale(), sum);
    return {std::sqrt(sum.shift), std::sqrt(sum.turn), std::sqrt(sum.growth)};
  }

  // The opinion of an edge with this relative pose about the node of another opinion.
  Opinion said_by(std::size_t edge, const Similarity3& first_from_second, Opinion opinion) const {
    opinion.edge = edge;
    opinion.first_from_second = first_from_second;
    opinion.first_from_node = first_from_second * pose_[opinion.node];
    opinion.in_first = first_from_second * opinion.in_second;
    opinion.quaternion = first_from_second.rigid().quaternion().coeffs();
    opinion.log_scale = std::log(first_from_second.scale());
    return opinion;
  }

  // Updates the proposals of the edges between a group and a higher one.
  void propose(std::size_t first, Between& between) {
    between.proposals.clear();
    between.asked = between.edges.size();
    std::vector<Opinion> opinions;  // one per edge
    opinions.reserve(between.edges.size());
    for (const std::size_t edge : between.edges) opinions.push_back(opinion(edge, first));
    const std::size_t step = (opinions.size() + kProposers - 1) / kProposers;
    // The most certain first, because a later one must have more votes to replace it.
    std::vector<std::size_t> proposers;
    for (std::size_t i = 0; i < opinions.size(); i += step) proposers.push_back(i);
    std::stable_sort(proposers.begin(), proposers.end(), [&](std::size_t a, std::size_t b) {
      return opinions[a].uncertainty < opinions[b].uncertainty;
    });
    std::vector<std::size_t> voters(opinions.size());
    std::iota(voters.begin(), voters.end(), std::size_t{0});
    while (between.proposals.size() < kKept && !proposers.empty()) {
      const Opinion* best = nullptr;
      std::size_t votes = 0;
      for (const std::size_t i : proposers) {
        std::size_t others = 0;  // votes against it
        for (std::size_t k = 0; k < voters.size() && others + votes < voters.size(); ++k) {
          others += agree(opinions[i], opinions[voters[k]]) ? 0 : 1;
        }
        if (others + votes >= voters.size()) continue;
        votes = voters.size() - others;
        best = &opinions[i];
      }
      if (best == nullptr) break;
      between.proposals.push_back({best->edge, best->first_from_second, votes, best->uncertainty});
      std::erase_if(voters, [&](std::size_t i) { return agree(*best, opinions[i]); });
      std::erase_if(proposers, [&](std::size_t i) { return agree(*best, opinions[i]); });
    }
  }

  // For each proposal: the number of edges that agree by way of third groups.
  std::vector<std::size_t> supports(std::size_t first, std::size_t second, const Between& own) {
    std::vector<std::size_t> result(own.proposals.size(), 0);
    std::vector<Opinion> opinions;
    for (const Proposal& proposal : own.proposals) {
      opinions.push_back(opinion(proposal.edge, first));
    }
    const bool fewer = beside_[first].size() <= beside_[second].size();
    for (const std::size_t third : beside_[fewer ? first : second]) {
      if (third == first || third == second) continue;
      const Between* const a = between(first, third);
      const Between* const b = between(third, second);
      if (a == nullptr || b == nullptr) continue;
      std::vector<std::size_t> most(opinions.size(), 0);
      for (const Proposal& to : a->proposals) {
        const Similarity3 first_from_third =
            first < third ? to.first_from_second : to.first_from_second.inverse();
        for (const Proposal& on : b->proposals) {
          const Similarity3 third_from_second =
              third < second ? on.first_from_second : on.first_from_second.inverse();
          const Similarity3 first_from_second = first_from_third * third_from_second;
          for (std::size_t i = 0; i < opinions.size(); ++i) {
            // Compares the path's pose of the same node.
            const Opinion& one = opinions[i];
            if (agree(one, said_by(to.edge, first_from_second, one))) {
              most[i] = std::max(most[i], std::min(to.votes, on.votes));
            }
          }
        }
      }
      for (std::size_t i = 0; i < most.size(); ++i) result[i] += most[i];
    }
    return result;
  }

  void enqueue(std::size_t first, std::size_t second, Between& between) {
    between.stamp = ++stamps_;
    if (within_runs_ && !share_a_run(first, second)) return;
    const std::vector<std::size_t> support = supports(first, second, between);
    std::size_t best = 0;
    const auto score = [&](std::size_t i) { return between.proposals[i].votes + support[i]; };
    for (std::size_t i = 1; i < between.proposals.size(); ++i) {
      if (score(i) > score(best)) best = i;
    }
    // Undecided if two proposals have the same score, unless they differ by no more than the groups drift: a long
    // loop closes.
    const std::size_t highest = score(best);
    for (std::size_t i = 0; i < between.proposals.size(); ++i) {
      if (i == best || score(i) != highest) continue;
      const Opinion one = opinion(between.proposals[best].edge, first);
      const Opinion other = opinion(between.proposals[i].edge, first);
      if (!agree(one, other, drift(one, other))) return;
    }
    std::swap(between.proposals[0], between.proposals[best]);
    queue_.push({highest, between.proposals[0].uncertainty, first, second, between.stamp});
  }

  PoseGroup group(std::size_t index) const {
    PoseGroup result;
    result.nodes = members_[index];
    std::sort(result.nodes.begin(), result.nodes.end());
    for (const std::size_t node : result.nodes) result.group_from_node.push_back(pose_[node]);
    return result;
  }

  // Records the edge that joins two groups. `node`, which goes, becomes the end of its group's tree of joints
  // that hangs on the other group.
  void record_joint(std::size_t node, Joint joint) {
    while (node != kNoIndex) {
      const Joint before = std::exchange(joints_[node], joint);
      joint = {node, before.edge};
      node = before.to;
    }
  }

  void join(std::size_t first, std::size_t second) {
    const Proposal how = between(first, second)->proposals.front();
    const bool second_stays = members_[second].size() > members_[first].size();
    const std::size_t stays = second_stays ? second : first;
    const std::size_t goes = second_stays ? first : second;
    const Similarity3 stays_from_goes =
        second_stays ? how.first_from_second.inverse() : how.first_from_second;
    const PoseEdge& edge = edges_[how.edge];
    const bool source_goes = group_of_[edge.source] == goes;
    record_joint(source_goes ? edge.source : edge.target,
                 {source_goes ? edge.target : edge.source, how.edge});
    for (const std::size_t node : members_[goes]) {
      pose_[node] = stays_from_goes * pose_[node];
      group_of_[node] = stays;
    }
    members_[stays].insert(members_[stays].end(), members_[goes].begin(), members_[goes].end());
    members_[goes].clear();
    neighbours_[std::min(first, second)].erase(std::max(first, second));

    std::vector<std::size_t> touched;
    for (const std::size_t third : beside_[goes]) {
      if (third == stays || members_[third].empty()) continue;
      const auto [low, high] = std::minmax(goes, third);
      const auto found = neighbours_[low].find(high);
      if (found == neighbours_[low].end()) continue;
      Between& merged = neighbours_[std::min(stays, third)][std::max(stays, third)];
      if (merged.edges.empty()) {
        beside_[stays].push_back(third);
        beside_[third].push_back(stays);
      }
      merged.edges.insert(merged.edges.end(), found->second.edges.begin(),
                          found->second.edges.end());
      neighbours_[low].erase(found);
      if (merged.is_to_be_asked()) touched.push_back(third);
    }
    beside_[goes].clear();
    std::erase_if(beside_[stays], [&](std::size_t third) { return members_[third].empty(); });
    if (members_[stays].size() >= 2 * refined_[stays]) {
      refined_[stays] = members_[stays].size();
      PoseGroup refined = group(stays);
      refine_(refined);
      for (std::size_t i = 0; i < refined.nodes.size(); ++i) {
        pose_[refined.nodes[i]] = refined.group_from_node[i];
      }
      touched = beside_[stays];
    }
    for (const std::size_t third : touched) {
      const auto [low, high] = std::minmax(stays, third);
      Between& changed = neighbours_[low][high];
      propose(low, changed);
    }
    for (const std::size_t third : touched) {
      const auto [low, high] = std::minmax(stays, third);
      enqueue(low, high, neighbours_[low][high]);
    }
  }

  std::span<const PoseEdge> edges_;
  std::span<const NodeExtent> extents_;
  std::span<const std::size_t> runs_;
  bool within_runs_ = true;  // only joins groups of one run
  std::size_t placed_group_ = kNoIndex;
  std::set<std::size_t> placed_runs_;  // of its nodes
  double agreement_;
  // Cosine of half the largest rotation that agrees for any uncertainty of the edges.
  double least_cosine_ = std::cos(0.5 * agreement_);
  const std::function<void(PoseGroup& group)>& refine_;
  std::vector<Deviations> deviations_;             // per edge
  std::vector<std::size_t> group_of_;              // per node; a group is named by its first node
  std::vector<Similarity3> pose_;                  // per node: in its group's frame
  std::vector<std::vector<std::size_t>> members_;  // per group; empty: it was joined to another
  std::vector<Joint> joints_;                      // per node; they form one tree per group
  std::vector<std::size_t> refined_;               // per group: its size at its last refinement
  std::vector<std::map<std::size_t, Between>> neighbours_;  // by the lower group, then the higher
  std::vector<std::vector<std::size_t>> beside_;            // per group: those with edges to it
  std::priority_queue<Entry> queue_;
  std::size_t stamps_ = 0;
};

}  // namespace

std::vector<PoseGroup> grow_groups(std::span<const PoseEdge> edges,
                                   std::span<const NodeExtent> extents,
                                   std::span<const std::size_t> runs, double agreement,
                                   const std::function<void(PoseGroup& group)>& refine,
                                   std::span<const std::optional<Similarity3>> placed) {
  return Growth(edges, extents, runs, agreement, refine, placed).run();
}

}  // namespace cairn::detail
