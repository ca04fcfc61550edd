// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>

namespace cairn {

/// Told now and then how far long work has come: a share in [0, 1]. Called from one thread at a
/// time; may be empty. To end the work early, use the std::stop_token beside it.
using Progress = std::function<void(double share)>;

}  // namespace cairn
