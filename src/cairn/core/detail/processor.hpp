// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace cairn::detail {

/// The kind of this processor, by which the C library and OpenCV choose instructions: "x86-64-v3" etc. (the
/// levels of the x86-64 psABI), or the architecture's name. Results may differ in last digits between kinds.
std::string processor_kind();

}  // namespace cairn::detail
