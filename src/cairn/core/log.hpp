// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <string_view>

namespace cairn {

/// Receives remarks of the library, e.g. which records it left out and why. The library never prints;
/// without a sink, remarks are dropped.
using LogSink = std::function<void(std::string_view remark)>;

}  // namespace cairn
