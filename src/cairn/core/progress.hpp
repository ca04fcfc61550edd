// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>

namespace cairn {

/// Called occasionally with the share of the work that is done, in [0, 1]. From one thread at a time; may
/// be empty. To cancel the work, use the std::stop_token passed with it.
using Progress = std::function<void(double share)>;

}  // namespace cairn
