// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/image.hpp"

#include <algorithm>
#include <array>
#include <csetjmp>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <new>
#include <type_traits>

#include <fmt/format.h>
#include <jerror.h>
#include <jpeglib.h>
#include <png.h>

#include "cairn/core/error.hpp"
#include "cairn/formats/map_file.hpp"

namespace cairn {
namespace {

using std::string_view_literals::operator""sv;

constexpr std::string_view kPngStart = "\x89PNG\r\n\x1a\n"sv;
constexpr std::string_view kPngEnd = "IEND\xae\x42\x60\x82"sv;
constexpr std::string_view kJpegStart = "\xff\xd8\xff"sv;
constexpr std::string_view kJpegEnd = "\xff\xd9"sv;

// Largest side and largest number of pixels of an image that is decoded. Both are checked against the file's header
// before anything is allocated.
constexpr std::uint32_t kLargestSide = 16384;
constexpr std::uint64_t kMostPixels = std::uint64_t{1} << 26;

// Why an image cannot be decoded or encoded; empty if it can.
using Fault = std::string;

// Header of an image file.
struct ImageHeader {
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  int channels = 0;  // as stored: 1 grey, 2 grey and alpha, 3 colour, 4 colour and alpha
  int bits = 8;      // of a channel: 1, 2, 4, 8 or 16
  bool has_palette = false;
};

// Rows in memory, of 8-bit grey, 8-bit colour or 16-bit grey.
struct PixelRows {
  unsigned char* first = nullptr;
  std::size_t stride = 0;  // bytes from row to row
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  bool color = false;
  bool deep = false;  // 16 bits
};

template <class Value, std::size_t kChannels>
PixelRows rows_of(Image<Value, kChannels>& image) {
  return {reinterpret_cast<unsigned char*>(image.values.data()),
          image.width * kChannels * sizeof(Value),
          image.width,
          image.height,
          kChannels == 3,
          sizeof(Value) == 2};
}

// --- libjpeg and libpng, which report faults by longjmp(), which never leaves a function here ---------

constexpr std::size_t kMessage = JMSG_LENGTH_MAX;

struct JpegErrors {
  jpeg_error_mgr manager;  // first, because libjpeg passes a pointer to it
  std::jmp_buf jump;
  std::array<char, kMessage> message;
};

struct PngErrors {
  std::jmp_buf jump;
  std::array<char, kMessage> message;
};

struct EncodedBytes {
  const unsigned char* next = nullptr;
  std::size_t left = 0;
};

// Runs `call`, which may jump to `jump`. It must not own anything then, because a jump skips destructors.
template <class Call>
bool finishes(std::jmp_buf& jump, const Call& call) {
  if (setjmp(jump) != 0) return false;
  call();
  return true;
}

// A damaged file may contain any number of scans, each of which costs as much as a whole image.
constexpr int kMostScans = 200;

[[noreturn]] void jump_out(j_common_ptr state) {
  auto* const errors = reinterpret_cast<JpegErrors*>(state->err);
  (*state->err->format_message)(state, errors->message.data());
  std::longjmp(errors->jump, 1);
}

// Counts warnings, which report damage that libjpeg fills in. Data that end early are an error.
void weigh_message(j_common_ptr state, int level) {
  if (level >= 0) return;
  if (state->err->msg_code == JWRN_JPEG_EOF) jump_out(state);
  ++state->err->num_warnings;
}

void print_nothing(j_common_ptr) {}

void prepare(JpegErrors& errors) {
  jpeg_std_error(&errors.manager);
  errors.manager.error_exit = jump_out;
  errors.manager.emit_message = weigh_message;
  errors.manager.output_message = print_nothing;
  errors.message[0] = '\0';
}

void count_scans(j_common_ptr state) {
  if (!state->is_decompressor) return;
  if (reinterpret_cast<j_decompress_ptr>(state)->input_scan_number > kMostScans) {
    auto* const errors = reinterpret_cast<JpegErrors*>(state->err);
    std::snprintf(errors->message.data(), errors->message.size(), "more than %d scans", kMostScans);
    std::longjmp(errors->jump, 1);
  }
}

[[noreturn]] void jump_out(png_structp state, png_const_charp message) {
  auto* const errors = static_cast<PngErrors*>(png_get_error_ptr(state));
  std::snprintf(errors->message.data(), errors->message.size(), "%s", message);
  std::longjmp(errors->jump, 1);
}

void ignore_warning(png_structp, png_const_charp) {}

void read_from_memory(png_structp state, png_bytep bytes, std::size_t size) {
  auto* const source = static_cast<EncodedBytes*>(png_get_io_ptr(state));
  if (size > source->left) png_error(state, "the data end early");
  std::memcpy(bytes, source->next, size);
  source->next += size;
  source->left -= size;
}

// Memory that grows without exceptions, because C code calls it.
struct GrowingBytes {
  unsigned char* bytes = nullptr;
  std::size_t size = 0;
  std::size_t capacity = 0;
  ~GrowingBytes() { std::free(bytes); }
};

void write_to_memory(png_structp state, png_bytep bytes, std::size_t size) {
  auto* const sink = static_cast<GrowingBytes*>(png_get_io_ptr(state));
  if (size > sink->capacity - sink->size) {
    const std::size_t capacity = std::max(sink->capacity * 2, sink->size + size);
    void* const grown = std::realloc(sink->bytes, capacity);
    if (grown == nullptr) png_error(state, "out of memory");
    sink->bytes = static_cast<unsigned char*>(grown);
    sink->capacity = capacity;
  }
  std::memcpy(sink->bytes + sink->size, bytes, size);
  sink->size += size;
}

void flush_nothing(png_structp) {}

// Decodes a file in memory: first its header, then its pixels.
class PngDecoder {
 public:
  explicit PngDecoder(std::string_view bytes)
      : source_{reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size()} {}
  ~PngDecoder() { png_destroy_read_struct(&state_, &info_, nullptr); }
  PngDecoder(const PngDecoder&) = delete;
  PngDecoder& operator=(const PngDecoder&) = delete;

  static constexpr bool kHasDepth = true;  // of 16 bits

  Fault read_header(ImageHeader& header) {
    state_ = png_create_read_struct(PNG_LIBPNG_VER_STRING, &errors_, jump_out, ignore_warning);
    if (state_ == nullptr) throw std::bad_alloc();
    info_ = png_create_info_struct(state_);
    if (info_ == nullptr) throw std::bad_alloc();
    const bool done = finishes(errors_.jump, [&] {
      png_set_read_fn(state_, &source_, read_from_memory);
      // The caller checks the size, because its error names the file.
      png_set_user_limits(state_, PNG_UINT_31_MAX, PNG_UINT_31_MAX);
      png_read_info(state_, info_);
    });
    if (!done) return errors_.message.data();
    header.width = png_get_image_width(state_, info_);
    header.height = png_get_image_height(state_, info_);
    header.channels = png_get_channels(state_, info_);
    header.bits = png_get_bit_depth(state_, info_);
    header.has_palette = png_get_color_type(state_, info_) == PNG_COLOR_TYPE_PALETTE;
    return {};
  }

  // @param rows of 16 bits only for a file of one such channel
  Fault read_pixels(const PixelRows& rows) {
    const bool done = finishes(errors_.jump, [&] {
      const png_byte kind = png_get_color_type(state_, info_);
      if (rows.deep) {
        png_set_swap(state_);  // the file is big-endian, this machine little-endian
      } else {
        png_set_strip_16(state_);
      }
      png_set_strip_alpha(state_);
      if (kind == PNG_COLOR_TYPE_PALETTE) png_set_palette_to_rgb(state_);
      if ((kind & PNG_COLOR_MASK_COLOR) == 0) png_set_expand_gray_1_2_4_to_8(state_);
      if (!rows.color) {
        png_set_rgb_to_gray(state_, PNG_ERROR_ACTION_NONE, 0.299, 0.587);
      } else if ((kind & PNG_COLOR_MASK_COLOR) != 0) {
        png_set_bgr(state_);
      } else {
        png_set_gray_to_rgb(state_);
      }
      const int passes = png_set_interlace_handling(state_);
      png_read_update_info(state_, info_);
      if (png_get_rowbytes(state_, info_) != rows.stride) {
        png_error(state_, "pixels of an unknown kind");
      }
      for (int pass = 0; pass < passes; ++pass) {
        for (std::uint32_t row = 0; row < rows.height; ++row) {
          png_read_row(state_, rows.first + row * rows.stride, nullptr);
        }
      }
      png_read_end(state_, nullptr);
    });
    return done ? Fault() : Fault(errors_.message.data());
  }

 private:
  PngErrors errors_ = {};
  EncodedBytes source_;
  png_structp state_ = nullptr;
  png_infop info_ = nullptr;
};

class JpegDecoder {
 public:
  explicit JpegDecoder(std::string_view bytes)
      : source_{reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size()} {}
  // All zeros before its creation; it then owns nothing.
  ~JpegDecoder() {
    if (state_.mem != nullptr) jpeg_destroy_decompress(&state_);
  }
  JpegDecoder(const JpegDecoder&) = delete;
  JpegDecoder& operator=(const JpegDecoder&) = delete;

  static constexpr bool kHasDepth = false;

  Fault read_header(ImageHeader& header) {
    prepare(errors_);
    state_.err = &errors_.manager;
    const bool done = finishes(errors_.jump, [&] {
      jpeg_create_decompress(&state_);
      progress_.progress_monitor = count_scans;
      state_.progress = &progress_;
      jpeg_mem_src(&state_, source_.next, source_.left);
      jpeg_read_header(&state_, TRUE);
    });
    if (!done) return errors_.message.data();
    header.width = state_.image_width;
    header.height = state_.image_height;
    header.channels = state_.num_components;
    return {};
  }

  Fault read_pixels(const PixelRows& rows) {
    if (state_.num_components == 4) return "four colours of print";
    const bool done = finishes(errors_.jump, [&] {
      state_.out_color_space = rows.color ? JCS_EXT_BGR : JCS_GRAYSCALE;
      jpeg_start_decompress(&state_);
      while (state_.output_scanline < state_.output_height) {
        JSAMPROW row = rows.first + state_.output_scanline * rows.stride;
        jpeg_read_scanlines(&state_, &row, 1);
      }
      jpeg_finish_decompress(&state_);
    });
    return done ? Fault() : Fault(errors_.message.data());
  }

 private:
  JpegErrors errors_ = {};
  EncodedBytes source_;
  jpeg_decompress_struct state_ = {};
  jpeg_progress_mgr progress_ = {};
};

// Appends an image to `bytes`.
Fault encode_png(const PixelRows& rows, std::string& bytes) {
  PngErrors errors;
  GrowingBytes sink;
  png_structp state =
      png_create_write_struct(PNG_LIBPNG_VER_STRING, &errors, jump_out, ignore_warning);
  if (state == nullptr) throw std::bad_alloc();
  png_infop info = png_create_info_struct(state);
  const bool done =
      info != nullptr && finishes(errors.jump, [&] {
        png_set_write_fn(state, &sink, write_to_memory, flush_nothing);
        // One filter and run lengths take half the time of any compression level, for 20 % more bytes. A
        // sequence is written once, at camera speed.
        png_set_filter(state, PNG_FILTER_TYPE_BASE, PNG_FILTER_SUB);
        png_set_compression_level(state, 1);
        png_set_compression_strategy(state, 3);  // Z_RLE
        png_set_IHDR(state, info, rows.width, rows.height, rows.deep ? 16 : 8,
                     rows.color ? PNG_COLOR_TYPE_RGB : PNG_COLOR_TYPE_GRAY, PNG_INTERLACE_NONE,
                     PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
        png_write_info(state, info);
        if (rows.color) png_set_bgr(state);
        if (rows.deep) png_set_swap(state);
        for (std::uint32_t row = 0; row < rows.height; ++row) {
          png_write_row(state, rows.first + row * rows.stride);
        }
        png_write_end(state, info);
      });
  png_destroy_write_struct(&state, &info);
  if (!done) return info == nullptr ? "out of memory" : errors.message.data();
  bytes.append(reinterpret_cast<const char*>(sink.bytes), sink.size);
  return {};
}

// @param quality 0 to 100
Fault encode_jpeg(const PixelRows& rows, int quality, std::string& bytes) {
  JpegErrors errors;
  prepare(errors);
  jpeg_compress_struct state;
  std::memset(&state, 0, sizeof state);
  state.err = &errors.manager;
  GrowingBytes sink;
  unsigned long size = 0;
  const bool done = finishes(errors.jump, [&] {
    jpeg_create_compress(&state);
    jpeg_mem_dest(&state, &sink.bytes, &size);
    state.image_width = rows.width;
    state.image_height = rows.height;
    state.input_components = rows.color ? 3 : 1;
    state.in_color_space = rows.color ? JCS_EXT_BGR : JCS_GRAYSCALE;
    jpeg_set_defaults(&state);
    jpeg_set_quality(&state, quality, TRUE);
    jpeg_start_compress(&state, TRUE);
    while (state.next_scanline < state.image_height) {
      JSAMPROW row = rows.first + state.next_scanline * rows.stride;
      jpeg_write_scanlines(&state, &row, 1);
    }
    jpeg_finish_compress(&state);
  });
  if (state.mem != nullptr) jpeg_destroy_compress(&state);
  if (!done) return errors.message.data();
  bytes.append(reinterpret_cast<const char*>(sink.bytes), size);
  return {};
}

// --- Files --------------------------------------------------------------------------------------------

[[noreturn]] void refuse(const std::filesystem::path& path, std::string_view what,
                         std::string_view expected) {
  throw Error(ErrorKind::kInput, path.string(), what, expected);
}

// Whether it is PNG or JPEG. libjpeg fills what is missing of a cut file with grey: look for the end mark first. Some cameras pad after it, so it may stand anywhere near the end.
bool is_complete_png(const std::filesystem::path& path, std::string_view bytes) {
  constexpr std::size_t kPadding = 4096;
  if (bytes.empty()) refuse(path, "the file is empty", "an image");
  const bool png = bytes.starts_with(kPngStart);
  if (!png && !bytes.starts_with(kJpegStart)) {
    const auto known = foreign_content(path);
    refuse(path, known ? known->what : "neither PNG nor JPEG", "a PNG or JPEG image");
  }
  const std::string_view tail = bytes.substr(bytes.size() - std::min(kPadding, bytes.size()));
  if (tail.find(png ? kPngEnd : kJpegEnd) == std::string_view::npos) {
    refuse(path, "the image is cut off", "its end mark");
  }
  return png;
}

template <class Decoder, class ImageOf>
void decode(const std::filesystem::path& path, Decoder&& decoder, ImageOf& image) {
  ImageHeader header;
  const auto check = [&](const Fault& fault) {
    reject_if(!fault.empty(), path.string(), "the image cannot be decoded: " + fault,
              "an undamaged image");
  };
  check(decoder.read_header(header));
  const bool too_large = header.width > kLargestSide || header.height > kLargestSide ||
                         std::uint64_t{header.width} * header.height > kMostPixels;
  reject_if(too_large, path.string(),
            fmt::format("an image of {} x {} pixels", header.width, header.height),
            fmt::format("at most {} pixels a side and {} in all", kLargestSide, kMostPixels));
  constexpr bool kHasDepth = std::decay_t<Decoder>::kHasDepth;
  if (rows_of(image).deep && (!kHasDepth || header.channels != 1 || header.bits != 16)) {
    const char* color = header.channels > 2 || header.has_palette ? "colour" : "grey";
    refuse(path,
           fmt::format("{}{} pixels of {} bits{}", kHasDepth ? "" : "JPEG: ", color, header.bits,
                       header.channels % 2 == 0 ? " with alpha" : ""),
           "one channel of 16 bits");
  }
  image = ImageOf(header.width, header.height);
  check(decoder.read_pixels(rows_of(image)));
}

// The bytes that `encode` appends; `where` names the image in errors.
template <class ImageOf, class Encode>
std::string encoded(const std::filesystem::path& where, const ImageOf& image,
                    const Encode& encode) {
  refuse_if(
      image.empty() || !image.consistent(), where.string(),
      fmt::format("{} x {} pixels with {} values", image.width, image.height, image.values.size()),
      "an image with a value for each channel of each pixel");
  std::string bytes;
  const Fault fault = encode(rows_of(const_cast<ImageOf&>(image)), bytes);
  if (!fault.empty()) {
    throw Error(ErrorKind::kStorage, where.string(), "cannot be encoded: " + fault, "an image");
  }
  return bytes;
}

template <class ImageOf>
std::string encoded_as_jpeg(const std::filesystem::path& where, const ImageOf& image, int quality) {
  return encoded(where, image, [quality](const PixelRows& rows, std::string& bytes) {
    return encode_jpeg(rows, quality, bytes);
  });
}

void write_bytes(const std::filesystem::path& path, const std::string& bytes,
                 Durability durability) {
  write_file(
      path, [&](const ByteSink& sink) { sink(bytes); }, durability);
}

}  // namespace

template <class ImageOf>
ImageOf decode_image(std::string_view bytes, const std::filesystem::path& name) {
  ImageOf image;
  if (is_complete_png(name, bytes)) {
    decode(name, PngDecoder(bytes), image);
  } else {
    decode(name, JpegDecoder(bytes), image);
  }
  return image;
}
template GrayImage decode_image(std::string_view, const std::filesystem::path&);
template ColorImage decode_image(std::string_view, const std::filesystem::path&);
template StoredDepthImage decode_image(std::string_view, const std::filesystem::path&);

GrayImage read_gray_image(const std::filesystem::path& path) {
  return decode_image<GrayImage>(read_file(path), path);
}

ColorImage read_color_image(const std::filesystem::path& path) {
  return decode_image<ColorImage>(read_file(path), path);
}

StoredDepthImage read_depth_image(const std::filesystem::path& path) {
  return decode_image<StoredDepthImage>(read_file(path), path);
}

DepthImage metric_depth(const StoredDepthImage& stored, double units_per_metre) {
  const auto metres_per_unit = static_cast<float>(1.0 / units_per_metre);
  DepthImage depth(stored.width, stored.height);
  std::transform(stored.values.begin(), stored.values.end(), depth.values.begin(),
                 [&](std::uint16_t units) { return static_cast<float>(units) * metres_per_unit; });
  return depth;
}

StoredDepthImage stored_depth(const DepthImage& depth_m, double units_per_metre) {
  constexpr double kMost = std::numeric_limits<std::uint16_t>::max();
  StoredDepthImage stored(depth_m.width, depth_m.height);
  for (std::size_t i = 0; i < stored.values.size(); ++i) {
    const double units = depth_m.values[i] * units_per_metre + 0.5;
    // Depths beyond the format's range become 0 (no reading), as for a real camera.
    if (units > 0.0 && units < kMost + 1.0) stored.values[i] = static_cast<std::uint16_t>(units);
  }
  return stored;
}

std::uint8_t gray_of(std::uint8_t blue, std::uint8_t green, std::uint8_t red) {
  // 0.299, 0.587 and the rest, of 2^15, and not rounded: as png_set_rgb_to_gray() has it.
  constexpr unsigned kRed = 9797;
  constexpr unsigned kGreen = 19234;
  constexpr unsigned kBlue = 32768 - kRed - kGreen;
  return static_cast<std::uint8_t>((kRed * red + kGreen * green + kBlue * blue) >> 15U);
}

template <class ImageOf>
void write_png(const std::filesystem::path& path, const ImageOf& image, Durability durability) {
  write_bytes(path, encoded(path, image, encode_png), durability);
}
template void write_png(const std::filesystem::path&, const GrayImage&, Durability);
template void write_png(const std::filesystem::path&, const ColorImage&, Durability);
template void write_png(const std::filesystem::path&, const StoredDepthImage&, Durability);

template <class ImageOf>
void write_jpeg(const std::filesystem::path& path, const ImageOf& image, int quality,
                Durability durability) {
  write_bytes(path, encoded_as_jpeg(path, image, quality), durability);
}
template void write_jpeg(const std::filesystem::path&, const GrayImage&, int, Durability);
template void write_jpeg(const std::filesystem::path&, const ColorImage&, int, Durability);

std::string jpeg_bytes(const ColorImage& image, int quality) {
  return encoded_as_jpeg("image", image, quality);
}

}  // namespace cairn
