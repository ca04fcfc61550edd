// SPDX-License-Identifier: BSD-3-Clause
#include "support/statistics.hpp"

#include "support/arguments.hpp"

namespace cairn::cli {

Json to_json(const ErrorStatistics& statistics) {
  return {{"count", statistics.count},
          {"rmse", statistics.rmse},
          {"mean", statistics.mean},
          {"median", statistics.median},
          {"std", statistics.standard_deviation},
          {"min", statistics.lowest},
          {"percentile_95", statistics.percentile_95},
          {"max", statistics.highest}};
}

ErrorStatistics in_degrees(ErrorStatistics radians) {
  for (double ErrorStatistics::*const field :
       {&ErrorStatistics::rmse, &ErrorStatistics::mean, &ErrorStatistics::median,
        &ErrorStatistics::standard_deviation, &ErrorStatistics::lowest,
        &ErrorStatistics::percentile_95, &ErrorStatistics::highest}) {
    radians.*field = degrees(radians.*field);
  }
  return radians;
}

}  // namespace cairn::cli
