// SPDX-License-Identifier: BSD-3-Clause
#include <cstring>
#include <string>

#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"
#include "cairn/formats/detail/foreign/foreign_formats.hpp"

#include "fuzz/round_trip.hpp"

// The input is the three files of a model, each behind its size as two bytes.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  std::string_view rest(reinterpret_cast<const char*>(data), size);
  const auto next = [&] {
    std::uint16_t length = 0;
    if (rest.size() >= sizeof length) {
      std::memcpy(&length, rest.data(), sizeof length);
      rest.remove_prefix(sizeof length);
    }
    const std::string_view file = rest.substr(0, length);
    rest.remove_prefix(file.size());
    return file;
  };
  cairn::MemoryReader cameras(next(), "input cameras");
  cairn::MemoryReader images(next(), "input images");
  cairn::MemoryReader points(next(), "input points3D");
  const auto read = [&](cairn::detail::ColmapForm form, bool with_images) {
    for (cairn::MemoryReader* file : {&cameras, &images, &points}) file->rewind();
    try {
      const cairn::LandmarkMap map = cairn::detail::read_colmap(
          {&cameras, with_images ? &images : nullptr, &points, nullptr}, form);
    } catch (const cairn::Error& error) {
      const std::string_view message = error.what();
      if (error.kind() != cairn::ErrorKind::kInput || !message.starts_with("input")) {
        cairn::testing::abort_because(std::string("refused otherwise: ") + error.what());
      }
    }
  };
  for (const bool with_images : {true, false}) {
    read(cairn::detail::ColmapForm::kBinary, with_images);
    read(cairn::detail::ColmapForm::kText, with_images);
  }
  return 0;
}
