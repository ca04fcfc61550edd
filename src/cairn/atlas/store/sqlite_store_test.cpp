// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/atlas/atlas.hpp"
