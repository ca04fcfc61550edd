// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/detail/search/nearest_field.hpp"

#include <algorithm>
#include <cmath>

namespace cairn::detail {
namespace {

// For each i of a line, the j that minimises (i - j)² + height[j]: the lower envelope of parabolas.
// Entries without a point are infinitely high.
class Envelope {
 public:
  explicit Envelope(std::size_t longest) : vertex_(longest), from_(longest + 1) {}

  template <class Assign>
  void lowest(std::span<const float> height, const Assign& assign) {
    int count = 0;
    const auto size = static_cast<int>(height.size());
    for (int j = 0; j < size; ++j) {
      if (!std::isfinite(height[at(j)])) continue;
      float start = -std::numeric_limits<float>::infinity();
      while (count > 0) {
        const int k = vertex_[at(count - 1)];
        start = ((height[at(j)] + static_cast<float>(j * j)) -
                 (height[at(k)] + static_cast<float>(k * k))) /
                static_cast<float>(2 * (j - k));
        if (start > from_[at(count - 1)]) break;
        --count;
      }
      if (count == 0) start = -std::numeric_limits<float>::infinity();
      vertex_[at(count)] = j;
      from_[at(count)] = start;
      ++count;
    }
    int current = 0;
    for (int i = 0; i < size && count > 0; ++i) {
      while (current + 1 < count && from_[at(current + 1)] < static_cast<float>(i)) ++current;
      assign(at(i), at(vertex_[at(current)]));
    }
  }

 private:
  static std::size_t at(int i) { return static_cast<std::size_t>(i); }

  std::vector<int> vertex_;
  std::vector<float> from_;  // where each parabola becomes the lowest
};

}  // namespace

NearestField::NearestField(std::span<const Eigen::Vector3f> points, const Box& box, float voxel,
                           std::size_t most_voxels)
    : low_(box.low) {
  const Eigen::Array3f extent = (box.high - box.low).array().max(voxel);
  const auto most = static_cast<float>(most_voxels);
  float edge = std::max(voxel, std::cbrt(extent.prod() / most));
  while ((extent / edge).ceil().prod() > most) edge *= 1.1F;
  per_length_ = 1.0F / edge;
  const Eigen::Array3f cells = (extent / edge).ceil();
  limit_ = cells;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    size_[axis] = static_cast<std::size_t>(cells[static_cast<Eigen::Index>(axis)]);
  }

  const auto total = static_cast<std::size_t>(cells.prod());
  nearest_.assign(total, kNone);
  std::vector<float> distance(total, std::numeric_limits<float>::infinity());
  for (std::uint32_t i = 0; i < points.size(); ++i) {
    const std::size_t place = voxel_of(points[i]);
    if (place == kOutside) continue;
    // Keeps the first of several points in a voxel.
    if (nearest_[place] != kNone) continue;
    nearest_[place] = i;
    distance[place] = 0.0F;
  }

  const std::array<std::size_t, 3> stride = {1, size_[0], size_[0] * size_[1]};
  const std::size_t longest = *std::max_element(size_.begin(), size_.end());
  Envelope envelope(longest);
  std::vector<float> height(longest);
  std::vector<std::uint32_t> owner(longest);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    // Neighbouring lines one after the other, because they share memory.
    const std::size_t b = axis == 0 ? 1 : 0;
    const std::size_t a = 3 - axis - b;
    for (std::size_t i = 0; i < size_[a]; ++i) {
      for (std::size_t j = 0; j < size_[b]; ++j) {
        const std::size_t begin = i * stride[a] + j * stride[b];
        for (std::size_t k = 0; k < size_[axis]; ++k) {
          height[k] = distance[begin + k * stride[axis]];
          owner[k] = nearest_[begin + k * stride[axis]];
        }
        envelope.lowest(std::span(height).first(size_[axis]),
                        [&](std::size_t to, std::size_t from) {
                          const auto offset = static_cast<float>(to) - static_cast<float>(from);
                          distance[begin + to * stride[axis]] = height[from] + offset * offset;
                          nearest_[begin + to * stride[axis]] = owner[from];
                        });
      }
    }
  }
}

}  // namespace cairn::detail
