// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/pose_graph/detail/block_cholesky.hpp"

#include <algorithm>
#include <array>

#include <Eigen/Cholesky>
#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>

namespace cairn::detail {
namespace {

using Eigen::Index;

// Largest share of zeros in a front that is merged with its parent, by their number of columns. For small
// fronts, the administration costs more than the arithmetic.
double most_zeros(std::size_t width) {
  if (width <= 4) return 0.5;
  return width <= 12 ? 0.2 : 0.05;
}

}  // namespace

BlockCholesky::BlockCholesky(std::size_t blocks, Index block_size, std::span<const Place> places)
    : blocks_(blocks), size_(block_size), places_(places.begin(), places.end()) {
  order();
  analyse();
  factors_.resize(fronts_.size());
}

// Minimum degree ordering, which takes the pattern as symmetric.
void BlockCholesky::order() {
  std::vector<Eigen::Triplet<double, int>> entries;
  for (std::size_t i = 0; i < blocks_; ++i) {
    entries.emplace_back(static_cast<int>(i), static_cast<int>(i), 1.0);
  }
  for (const auto& [row, column] : places_) {
    entries.emplace_back(static_cast<int>(row), static_cast<int>(column), 1.0);
  }
  const auto count = static_cast<Index>(blocks_);
  Eigen::SparseMatrix<double, Eigen::ColMajor, int> pattern(count, count);
  pattern.setFromTriplets(entries.begin(), entries.end());
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> order;
  Eigen::AMDOrdering<int>()(pattern, order);
  position_.resize(blocks_);
  for (std::size_t i = 0; i < blocks_; ++i) {
    position_[static_cast<std::size_t>(order.indices()[static_cast<Index>(i)])] = i;
  }
}

void BlockCholesky::analyse() {
  // For each position, the earlier positions with which it has a block.
  const auto earlier_of = [&] {
    std::vector<std::vector<std::size_t>> earlier(blocks_);
    for (const auto& [row, column] : places_) {
      const auto [low, high] = std::minmax(position_[row], position_[column]);
      earlier[high].push_back(low);
    }
    return earlier;
  };
  // The elimination tree (Liu 1990): the parent of a column is the first below it that its elimination changes.
  const auto tree_of = [&](const std::vector<std::vector<std::size_t>>& earlier) {
    std::vector<std::size_t> parent(blocks_, kNone);
    std::vector<std::size_t> ancestor(blocks_, kNone);
    for (std::size_t j = 0; j < blocks_; ++j) {
      for (std::size_t i : earlier[j]) {
        while (i < j) {  // kNone is no less
          const std::size_t next = ancestor[i];
          ancestor[i] = j;
          if (next == kNone) parent[i] = j;
          i = next;
        }
      }
    }
    return parent;
  };
  // In depth-first order, columns that are eliminated together are adjacent.
  const std::vector<std::size_t> unordered = tree_of(earlier_of());
  std::vector<std::vector<std::size_t>> children(blocks_);
  std::vector<std::size_t> stack;
  for (std::size_t i = 0; i < blocks_; ++i) {
    (unordered[i] == kNone ? stack : children[unordered[i]]).push_back(i);
  }
  std::vector<std::size_t> walked(blocks_);
  // Parents first, numbered from the end.
  for (std::size_t next = blocks_; !stack.empty();) {
    const std::size_t i = stack.back();
    stack.pop_back();
    walked[i] = --next;
    stack.insert(stack.end(), children[i].begin(), children[i].end());
  }
  row_at_.resize(blocks_);
  for (std::size_t row = 0; row < blocks_; ++row) {
    position_[row] = walked[position_[row]];
    row_at_[position_[row]] = row;
  }

  const std::vector<std::vector<std::size_t>> earlier = earlier_of();
  const std::vector<std::size_t> parent = tree_of(earlier);
  std::vector<std::vector<std::size_t>> below(blocks_);
  for (std::size_t high = 0; high < blocks_; ++high) {
    for (const std::size_t low : earlier[high]) below[low].push_back(high);
  }
  for (std::size_t j = 0; j < blocks_; ++j) {
    std::sort(below[j].begin(), below[j].end());
    below[j].erase(std::unique(below[j].begin(), below[j].end()), below[j].end());
    if (parent[j] == kNone) continue;
    std::vector<std::size_t>& inherits = below[parent[j]];
    inherits.insert(inherits.end(), below[j].begin() + 1, below[j].end());
  }
  merge_columns(below, parent);
  place_updates();

  for (std::size_t i = 0; i < places_.size(); ++i) {
    const auto [low, high] = std::minmax(position_[places_[i].first], position_[places_[i].second]);
    fronts_[front_of_[low]].entries.push_back(i);
  }
}

// Makes fronts of columns with nearly the same rows as their parents.
void BlockCholesky::merge_columns(const std::vector<std::vector<std::size_t>>& below,
                                  const std::vector<std::size_t>& parent) {
  front_of_.assign(blocks_, kNone);
  // From the last column: each starts a front, or joins the one that starts after it.
  std::vector<Front> reversed;
  double zeros = 0.0;  // blocks of the last front's columns that are zero
  for (std::size_t j = blocks_; j-- > 0;) {
    if (parent[j] == j + 1) {
      Front& last = reversed.back();
      const std::size_t width = last.width + 1;
      const double more =
          static_cast<double>(last.width + last.rows.size()) - static_cast<double>(below[j].size());
      const double columns = static_cast<double>(width);
      const double all =
          columns * (columns + 1.0) / 2.0 + columns * static_cast<double>(last.rows.size());
      if (zeros + more <= most_zeros(width) * all) {
        last.first = j;
        last.width = width;
        zeros += more;
        continue;
      }
    }
    Front front;
    front.first = j;
    front.width = 1;
    front.rows = below[j];
    reversed.push_back(std::move(front));
    zeros = 0.0;
  }
  fronts_.assign(std::make_move_iterator(reversed.rbegin()),
                 std::make_move_iterator(reversed.rend()));
  for (std::size_t f = 0; f < fronts_.size(); ++f) {
    for (std::size_t k = 0; k < fronts_[f].width; ++k) front_of_[fronts_[f].first + k] = f;
  }
  for (std::size_t f = 0; f < fronts_.size(); ++f) {
    Front& front = fronts_[f];
    if (front.rows.empty()) continue;
    front.parent = front_of_[front.rows.front()];
    Front& above = fronts_[front.parent];
    above.children.push_back(f);
    auto at = above.rows.begin();
    for (const std::size_t row : front.rows) {
      if (row < above.first + above.width) {
        front.in_parent.push_back(static_cast<Index>(row - above.first));
        continue;
      }
      at = std::lower_bound(at, above.rows.end(), row);
      front.in_parent.push_back(static_cast<Index>(above.width) + (at - above.rows.begin()));
    }
  }
}

// Fronts of even and of odd depth have a stack each: a front's update is placed where those of the fronts under its
// children were, while its children's are still needed.
void BlockCholesky::place_updates() {
  std::vector<std::size_t> depth(fronts_.size(), 0);
  for (std::size_t f = fronts_.size(); f-- > 0;) {
    if (fronts_[f].parent != kNone) depth[f] = depth[fronts_[f].parent] + 1;
  }
  const auto length = [&](const Front& front) {
    const std::size_t rows = front.rows.size() * static_cast<std::size_t>(size_);
    return rows * rows;
  };
  std::array<std::size_t, 2> tops{};
  std::array<std::size_t, 2> highest{};
  for (std::size_t f = 0; f < fronts_.size(); ++f) {
    std::size_t& top = tops[depth[f] % 2];
    fronts_[f].update = top;
    top += length(fronts_[f]);
    highest[depth[f] % 2] = std::max(highest[depth[f] % 2], top);
    for (const std::size_t child : fronts_[f].children) {
      tops[1 - depth[f] % 2] -= length(fronts_[child]);
    }
  }
  for (std::size_t f = 0; f < fronts_.size(); ++f) {
    if (depth[f] % 2 == 1) fronts_[f].update += highest[0];
  }
  updates_.resize(highest[0] + highest[1]);
}

bool BlockCholesky::factor(const Eigen::MatrixXd& diagonal, const Eigen::MatrixXd& others) {
  // The update of a front's rows: its lower triangle.
  using Update = Eigen::Map<Eigen::MatrixXd>;
  for (std::size_t f = 0; f < fronts_.size(); ++f) {
    const Front& front = fronts_[f];
    const Index columns = static_cast<Index>(front.width) * size_;
    const Index rows = static_cast<Index>(front.rows.size()) * size_;
    Eigen::MatrixXd& own = factors_[f];
    own.setZero(columns + rows, columns);
    Update update(updates_.data() + front.update, rows, rows);
    for (Index c = 0; c < rows; ++c) update.col(c).tail(rows - c).setZero();
    for (std::size_t k = 0; k < front.width; ++k) {
      const Index at = static_cast<Index>(k) * size_;
      own.block(at, at, size_, size_) =
          diagonal.middleCols(static_cast<Index>(row_at_[front.first + k]) * size_, size_);
    }
    for (const std::size_t entry : front.entries) {
      const auto [row, column] = places_[entry];
      const bool is_below = position_[row] > position_[column];
      const std::size_t low = is_below ? position_[column] : position_[row];
      const std::size_t high = is_below ? position_[row] : position_[column];
      const Index at_column = static_cast<Index>(low - front.first) * size_;
      Index at_row = static_cast<Index>(high - front.first);
      if (high >= front.first + front.width) {
        const auto found = std::lower_bound(front.rows.begin(), front.rows.end(), high);
        at_row = static_cast<Index>(front.width) + (found - front.rows.begin());
      }
      const auto block = others.middleCols(static_cast<Index>(entry) * size_, size_);
      auto sum = own.block(at_row * size_, at_column, size_, size_);
      if (is_below) {
        sum += block;
      } else {
        sum += block.transpose();
      }
    }
    for (const std::size_t child : front.children) {
      const std::vector<Index>& places = fronts_[child].in_parent;
      const auto count = static_cast<Index>(places.size());
      const Update added(updates_.data() + fronts_[child].update, count * size_, count * size_);
      for (Index j = 0; j < count; ++j) {
        const Index to = places[static_cast<std::size_t>(j)];
        const bool to_own = to < static_cast<Index>(front.width);
        const Index shift = to_own ? 0 : static_cast<Index>(front.width);
        for (Index c = 0; c < size_; ++c) {
          const double* const source = added.col(j * size_ + c).data();
          const Index column = (to - shift) * size_ + c;
          double* const target = to_own ? own.col(column).data() : update.col(column).data();
          const Index diagonal_at = (to - shift) * size_;
          for (Index r = c; r < size_; ++r) target[diagonal_at + r] += source[j * size_ + r];
          for (Index i = j + 1; i < count; ++i) {
            const Index from = i * size_;
            const Index at = (places[static_cast<std::size_t>(i)] - shift) * size_;
            for (Index r = 0; r < size_; ++r) target[at + r] += source[from + r];
          }
        }
      }
    }
    auto top = own.topRows(columns);
    const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> root(top);
    if (root.info() != Eigen::Success) return false;
    if (rows == 0) continue;
    auto bottom = own.bottomRows(rows);
    top.triangularView<Eigen::Lower>().transpose().solveInPlace<Eigen::OnTheRight>(bottom);
    update.selfadjointView<Eigen::Lower>().rankUpdate(bottom, -1.0);
  }
  return true;
}

Eigen::VectorXd BlockCholesky::solve(const Eigen::VectorXd& right) const {
  Eigen::VectorXd x(right.size());
  for (std::size_t i = 0; i < blocks_; ++i) {
    x.segment(static_cast<Index>(position_[i]) * size_, size_) =
        right.segment(static_cast<Index>(i) * size_, size_);
  }
  Eigen::VectorXd part;
  for (std::size_t f = 0; f < fronts_.size(); ++f) {
    const Front& front = fronts_[f];
    const Index columns = static_cast<Index>(front.width) * size_;
    const Index rows = static_cast<Index>(front.rows.size()) * size_;
    auto own = x.segment(static_cast<Index>(front.first) * size_, columns);
    factors_[f].topRows(columns).triangularView<Eigen::Lower>().solveInPlace(own);
    if (rows == 0) continue;
    part.noalias() = factors_[f].bottomRows(rows) * own;
    for (std::size_t k = 0; k < front.rows.size(); ++k) {
      x.segment(static_cast<Index>(front.rows[k]) * size_, size_) -=
          part.segment(static_cast<Index>(k) * size_, size_);
    }
  }
  for (std::size_t f = fronts_.size(); f-- > 0;) {
    const Front& front = fronts_[f];
    const Index columns = static_cast<Index>(front.width) * size_;
    const Index rows = static_cast<Index>(front.rows.size()) * size_;
    auto own = x.segment(static_cast<Index>(front.first) * size_, columns);
    if (rows > 0) {
      part.resize(rows);
      for (std::size_t k = 0; k < front.rows.size(); ++k) {
        part.segment(static_cast<Index>(k) * size_, size_) =
            x.segment(static_cast<Index>(front.rows[k]) * size_, size_);
      }
      own.noalias() -= factors_[f].bottomRows(rows).transpose() * part;
    }
    factors_[f].topRows(columns).triangularView<Eigen::Lower>().transpose().solveInPlace(own);
  }
  Eigen::VectorXd result(right.size());
  for (std::size_t i = 0; i < blocks_; ++i) {
    result.segment(static_cast<Index>(i) * size_, size_) =
        x.segment(static_cast<Index>(position_[i]) * size_, size_);
  }
  return result;
}

Eigen::MatrixXd BlockCholesky::inverse_diagonal() const {
  Eigen::MatrixXd result(size_, static_cast<Index>(blocks_) * size_);
  // Per front: the inverse in its columns and rows, until its children have used it.
  std::vector<Eigen::MatrixXd> inverses(fronts_.size());
  std::vector<std::size_t> waiting(fronts_.size());
  for (std::size_t f = fronts_.size(); f-- > 0;) {
    const Front& front = fronts_[f];
    waiting[f] = front.children.size();
    const Index columns = static_cast<Index>(front.width) * size_;
    const Index rows = static_cast<Index>(front.rows.size()) * size_;
    Eigen::MatrixXd& inverse = inverses[f];
    inverse.resize(columns + rows, columns + rows);
    const auto root = factors_[f].topRows(columns).triangularView<Eigen::Lower>();
    // With the factor's parts L1 of the columns and L2 of the rows below, and the inverse Z of the rows:
    //   Y = L2 / L1,  inverse of rows and columns -Z Y,  of the columns 1 / (L1 L1') + Y' Z Y.
    Eigen::MatrixXd root_inverse = Eigen::MatrixXd::Identity(columns, columns);
    root.solveInPlace(root_inverse);
    auto own = inverse.topLeftCorner(columns, columns);
    own.noalias() = root_inverse.transpose().triangularView<Eigen::Upper>() * root_inverse;
    if (rows > 0) {
      const Eigen::MatrixXd& above = inverses[front.parent];
      auto below = inverse.bottomRightCorner(rows, rows);
      const std::vector<Index>& places = front.in_parent;
      const auto count = static_cast<Index>(places.size());
      for (Index j = 0; j < count; ++j) {
        for (Index c = 0; c < size_; ++c) {
          const double* const source =
              above.col(places[static_cast<std::size_t>(j)] * size_ + c).data();
          double* const target = &below(0, j * size_ + c);
          for (Index i = 0; i < count; ++i) {
            const Index at = places[static_cast<std::size_t>(i)] * size_;
            for (Index r = 0; r < size_; ++r) target[i * size_ + r] = source[at + r];
          }
        }
      }
      const Eigen::MatrixXd slope =
          factors_[f].bottomRows(rows) * root_inverse.triangularView<Eigen::Lower>();
      auto beside = inverse.bottomLeftCorner(rows, columns);
      beside.noalias() = -below * slope;
      own.noalias() -= slope.transpose() * beside;
      if (!front.children.empty()) inverse.topRightCorner(columns, rows) = beside.transpose();
      if (--waiting[front.parent] == 0) inverses[front.parent].resize(0, 0);
    }
    for (std::size_t k = 0; k < front.width; ++k) {
      const Index at = static_cast<Index>(k) * size_;
      result.middleCols(static_cast<Index>(row_at_[front.first + k]) * size_, size_) =
          inverse.block(at, at, size_, size_);
    }
    if (front.children.empty()) inverse.resize(0, 0);
  }
  return result;
}

}  // namespace cairn::detail
