// SPDX-License-Identifier: BSD-3-Clause
#include <utility>

#include <fmt/format.h>

#include "cairn/map/synthetic.hpp"

#include "demo_pair.hpp"

namespace cairn::cli {

DemoPair synthetic_demo(const CommonArguments& common) {
  SyntheticPair pair = synthetic_pair({.seed = common.seed});
  DemoPair demo;
  demo.story = fmt::format(
      "Two synthetic sessions over one desk: {} and {} landmarks, of which {} are the same "
      "points.\n",
      pair.source.landmark_count(), pair.target.landmark_count(), pair.shared.size());
  demo.description = {{"landmarks",
                       {{"source", pair.source.landmark_count()},
                        {"target", pair.target.landmark_count()},
                        {"shared", pair.shared.size()}}}};
  demo.source = std::move(pair.source);
  demo.target = std::move(pair.target);
  demo.target_from_source = pair.target_from_source;
  return demo;
}

}  // namespace cairn::cli
