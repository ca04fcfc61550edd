// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/exif.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

#include <libexif/exif-data.h>
#include <libexif/exif-utils.h>

namespace cairn {
namespace {

// A positive number of a tag.
std::optional<double> number(ExifData* data, ExifTag tag) {
  ExifEntry* const entry = exif_data_get_entry(data, tag);
  if (entry == nullptr || entry->components < 1) return std::nullopt;
  const ExifByteOrder order = exif_data_get_byte_order(data);
  double value = 0.0;
  if (entry->format == EXIF_FORMAT_SHORT && entry->size >= 2) {
    value = exif_get_short(entry->data, order);
  } else if (entry->format == EXIF_FORMAT_LONG && entry->size >= 4) {
    value = exif_get_long(entry->data, order);
  } else if (entry->format == EXIF_FORMAT_RATIONAL && entry->size >= 8) {
    const ExifRational ratio = exif_get_rational(entry->data, order);
    value = ratio.denominator == 0 ? 0.0 : static_cast<double>(ratio.numerator) / ratio.denominator;
  }
  return value > 0.0 ? std::optional(value) : std::nullopt;
}

// Pixels of the sensor's own image per millimetre.
std::optional<double> resolution(ExifData* data) {
  const std::optional<double> per_unit = number(data, EXIF_TAG_FOCAL_PLANE_X_RESOLUTION);
  constexpr double kInch = 25.4;
  constexpr double kCentimetre = 10.0;
  constexpr double kCodeOfCentimetre = 3.0;  // 2, the default, is an inch
  const double code = number(data, EXIF_TAG_FOCAL_PLANE_RESOLUTION_UNIT).value_or(2.0);
  if (!per_unit) return std::nullopt;
  return *per_unit / (code == kCodeOfCentimetre ? kCentimetre : kInch);
}

}  // namespace

std::optional<double> exif_focal_length(std::string_view bytes, std::uint32_t width,
                                        std::uint32_t height) {
  // EXIF data stand in the first 64 KiB behind the start.
  const std::size_t size = std::min<std::size_t>(bytes.size(), std::size_t{1} << 18);
  const std::unique_ptr<ExifData, decltype(&exif_data_unref)> data(
      exif_data_new_from_data(reinterpret_cast<const unsigned char*>(bytes.data()),
                              static_cast<unsigned int>(size)),
      &exif_data_unref);
  if (data == nullptr) return std::nullopt;
  constexpr double kDiagonal = 43.2666;  // of a 35 mm frame, mm
  if (const auto of_film = number(data.get(), EXIF_TAG_FOCAL_LENGTH_IN_35MM_FILM)) {
    return *of_film / kDiagonal * std::hypot(width, height);
  }
  const auto focal_length = number(data.get(), EXIF_TAG_FOCAL_LENGTH);
  const auto per_mm = resolution(data.get());
  if (!focal_length || !per_mm) return std::nullopt;
  // The image may have been made smaller.
  const double larger = std::max(width, height);
  const double stored = std::max(number(data.get(), EXIF_TAG_PIXEL_X_DIMENSION).value_or(larger),
                                 number(data.get(), EXIF_TAG_PIXEL_Y_DIMENSION).value_or(0.0));
  return *focal_length * *per_mm * larger / stored;
}

}  // namespace cairn
