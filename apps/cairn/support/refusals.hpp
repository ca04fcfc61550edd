// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string_view>

#include "cairn/core/error.hpp"

namespace cairn::cli {

/// @throws Error (misuse) naming an option or argument, what is wrong with it and what is expected, if it is `wrong`
inline void refuse_if(bool wrong, std::string_view option, std::string_view what,
                      std::string_view expected) {
  if (wrong) throw Error(ErrorKind::kMisuse, option, what, expected);
}

/// @throws Error (input) naming a file if what it holds is `wrong`
inline void reject_if(bool wrong, std::string_view file, std::string_view what,
                      std::string_view expected) {
  if (wrong) throw Error(ErrorKind::kInput, file, what, expected);
}

}  // namespace cairn::cli
