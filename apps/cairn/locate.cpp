// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <system_error>
#include <tuple>
#include <utility>
#include <vector>

#include <fmt/format.h>

#ifdef CAIRN_HAS_ATLAS
#include "cairn/atlas/atlas.hpp"
#include "cairn/atlas/queries.hpp"
#include "cairn/atlas/store/open_store.hpp"
#endif
#include "cairn/adjustment/adjust.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/core/text.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/formats/trajectory_file.hpp"
#include "cairn/geometry/angles.hpp"
#include "cairn/vision/exif.hpp"
#include "cairn/vision/image.hpp"
#include "cairn/vision/image_locator.hpp"
#include "cairn/vision/map_images.hpp"
#include "cairn/vision/sequence.hpp"

#include "commands.hpp"
#include "support/arguments.hpp"
#include "support/documents.hpp"
#include "support/location_hints.hpp"
#include "support/map_lists.hpp"
#include "support/reports.hpp"

namespace cairn::cli {
namespace {

namespace fs = std::filesystem;

// @param map whose landmarks the matches show
Json json_of(const std::string& image, const ImageLocation& found, const LandmarkMap& map) {
  Json json = {{"image", image},
               {"verdict", found.located ? "located" : "rejected"},
               {"probability", found.probability},
               {"reason", found.reason},
               {"failure", nullptr},
               {"world_from_camera", nullptr},
               {"estimate", nullptr},
               {"rival", nullptr},
               {"covariance", nullptr},
               {"camera", to_json(found.camera)},
               {"focal_length_sigma", nullptr},
               {"corners", found.corners},
               {"matches", Json::array()}};
  if (found.world_from_camera) json["world_from_camera"] = to_json(*found.world_from_camera);
  if (found.estimate) json["estimate"] = to_json(*found.estimate);
  if (found.failure) json["failure"] = to_string(*found.failure);
  if (found.rival) json["rival"] = to_json(*found.rival);
  if (found.covariance) json["covariance"] = to_json(*found.covariance);
  if (found.focal_length_sigma) json["focal_length_sigma"] = *found.focal_length_sigma;
  for (const ImageMatch& match : found.matches) {
    const LandmarkId landmark = map.landmarks().ids[match.landmark.value];
    json["matches"].push_back({landmark.value, match.pixel.u, match.pixel.v});
  }
  return json;
}

std::string_view decision_of(const ImageLocation& found) {
  return found.located ? "located" : "rejected";
}

// @param said what the first line says
// @param stated focal length by EXIF data
std::string text_of(const std::string& image, const std::string& said, const ImageLocation& found,
                    const std::optional<double>& stated, LengthUnit unit) {
  std::string text = fmt::format("{}: {}\n", fs::path(image).filename().string(), said);
  // What is all but wrong misleads.
  constexpr double kWorthShowing = 0.01;
  if (!found.estimate || found.probability < kWorthShowing) return text;
  const Eigen::Vector3d& at = found.estimate->translation();
  const Eigen::Quaterniond turn = found.estimate->quaternion();
  text +=
      fmt::format("  {}tx ty tz qx qy qz qw  {:.4f} {:.4f} {:.4f} {:.6f} {:.6f} {:.6f} {:.6f}\n",
                  found.located ? "" : "not trusted: ", at.x(), at.y(), at.z(), turn.x(), turn.y(),
                  turn.z(), turn.w());
  if (found.covariance) {
    const Vector6d deviations = found.covariance->diagonal().cwiseSqrt();
    text +=
        fmt::format("  standard deviations   {:.2g} {:.2g} {:.2g} {}, {:.2g} {:.2g} {:.2g} deg\n",
                    deviations[0], deviations[1], deviations[2], unit_symbol(unit),
                    degrees(deviations[3]), degrees(deviations[4]), degrees(deviations[5]));
  }
  if (found.located && found.focal_length_sigma) {
    text += fmt::format("  focal length          {:.1f} px, standard deviation {:.2g} px{}\n",
                        found.camera.parameters.front(), *found.focal_length_sigma,
                        stated ? fmt::format("; {:.1f} px by EXIF", *stated) : "");
  }
  return text;
}

// The paths, with the images of a folder in its place.
std::vector<std::string> listed_images(const std::vector<std::string>& paths) {
  std::vector<std::string> images;
  for (const std::string& path : paths) {
    std::error_code ignored;
    if (!fs::is_directory(path, ignored)) {
      images.push_back(path);
      continue;
    }
    const std::vector<std::string> files = files_in(path, {".jpg", ".jpeg", ".png"});
    reject_if(files.empty(), path, "no image is in this folder", "JPEG or PNG files");
    images.insert(images.end(), files.begin(), files.end());
  }
  return images;
}

// What a line begins with: the times that all names of images are, or else the images' numbers.
std::vector<std::string> stamps_of(const std::vector<std::string>& images) {
  std::vector<std::string> times;
  std::vector<std::string> numbers;
  for (std::size_t i = 0; i < images.size(); ++i) {
    numbers.push_back(fmt::format("{}", i));
    const std::string stem = fs::path(images[i]).stem().string();
    if (parse_number(stem)) times.push_back(stem);
  }
  return times.size() == images.size() ? times : numbers;
}

// What new frames of a map are called: the names of their files. As merge() does, where images share one, the names of all
// images of a folder begin with the folder, or as many folders as tell them apart. The map's own names stay.
std::vector<std::string> image_names(const std::vector<std::string>& files,
                                     const LandmarkMap& map) {
  std::vector<PossibleNames> possible;
  for (const std::string& file : files) {
    const fs::path path = fs::absolute(file).lexically_normal().relative_path();
    fs::path folder = path.parent_path();
    PossibleNames image{folder.string(), {path.filename().string()}};
    for (; !folder.empty(); folder = folder.parent_path()) {
      std::string word = folder.filename().string();
      std::replace(word.begin(), word.end(), ' ', '_');  // COLMAP ends a name at a blank
      image.names.push_back(word + "/" + image.names.back());
    }
    possible.push_back(std::move(image));
  }
  return told_apart(possible, map.frames().image_names);
}

// The locators of images: with the given camera, with that of the map's image of the same name, with the map's only one
// for their size, or with a focal length to be found. The search for it begins at that of the image's EXIF data.
class Locators {
 public:
  // @param takes_map whether images may be by cameras of the map
  Locators(const LandmarkMap& map, const std::optional<Camera>& given, bool takes_map,
           const LocateOptions& options)
      : is_given_(given.has_value()),
        first_{ImageLocator(map, given.value_or(unknown_camera(kAnySide, kAnySide)), options),
               FocalLength::kKnown,
               {}} {
    if (!takes_map) return;
    cameras_ = {map.cameras().begin(), map.cameras().end()};
    const FrameTable& frames = map.frames();
    for (std::size_t f = 0; f < frames.image_names.size() && !frames.cameras.empty(); ++f) {
      if (frames.image_names[f].empty() || !frames.cameras[f]) continue;
      const Camera* const camera = &cameras_[frames.cameras[f]->value];
      const auto [place, is_new] = of_name_.try_emplace(file_name(frames.image_names[f]), camera);
      if (is_new || place->second == nullptr) continue;
      if (!is_same_lens(*place->second, *camera)) place->second = nullptr;
    }
  }

  struct OfCamera {
    ImageLocator locator;
    FocalLength lens;
    std::optional<double> stated;  // focal length by EXIF data, where the search begins
  };

  /// Thread-safe.
  /// @param path, bytes the image's file
  const OfCamera& of(const GrayImage& image, const std::string& path, std::string_view bytes) {
    if (is_given_) return first_;
    const auto named = of_name_.find(file_name(path));
    const Camera* known = named != of_name_.end() ? named->second : nullptr;
    if (known == nullptr || known->width != image.width || known->height != image.height) {
      known = only_of(image.width, image.height);
    }
    if (known == nullptr) return of_unknown(image, bytes);
    return at({image.width, image.height, known, std::nullopt}, *known);
  }
  /// Where the camera is not that of the map's images of this size.
  const OfCamera& of_unknown(const GrayImage& image, std::string_view bytes) {
    const auto stated = exif_focal_length(bytes, image.width, image.height);
    return at({image.width, image.height, nullptr, stated},
              unknown_camera(image.width, image.height, stated));
  }

 private:
  static constexpr std::uint32_t kAnySide = 64;  // without a given camera, the first has no use

  static Camera unknown_camera(std::uint32_t width, std::uint32_t height,
                               const std::optional<double>& stated = {}) {
    constexpr double kUsual = 1.2;  // focal length of photographs, in larger sides
    return {CameraId{0},
            "SIMPLE_PINHOLE",
            width,
            height,
            {stated.value_or(kUsual * std::max(width, height)), 0.5 * (width - 1.0),
             0.5 * (height - 1.0)}};
  }

  // Width, height, the camera if it is known, and otherwise the focal length of EXIF data.
  using Key = std::tuple<std::uint32_t, std::uint32_t, const Camera*, std::optional<double>>;

  const OfCamera& at(const Key& key, const Camera& camera) {
    const std::lock_guard lock(mutex_);
    const auto [place, is_new] = locators_.try_emplace(key);
    if (is_new) {
      const FocalLength lens =
          std::get<2>(key) != nullptr ? FocalLength::kKnown : FocalLength::kUnknown;
      place->second = std::make_unique<OfCamera>(
          OfCamera{first_.locator.with_camera(camera, lens), lens, std::get<3>(key)});
    }
    return *place->second;
  }

  // The camera of that size; null if there is none or several lenses are.
  const Camera* only_of(std::uint32_t width, std::uint32_t height) const {
    const Camera* only = nullptr;
    for (const Camera& camera : cameras_) {
      if (camera.width != width || camera.height != height) continue;
      if (only != nullptr && !is_same_lens(camera, *only)) return nullptr;
      only = &camera;
    }
    return only;
  }

  bool is_given_;
  std::vector<Camera> cameras_;
  // By the names of image files; null if images of one name are by different cameras.
  std::map<std::string, const Camera*> of_name_;
  OfCamera first_;
  std::mutex mutex_;
  std::map<Key, std::unique_ptr<OfCamera>> locators_;
};

struct LocateArguments {
  CommonArguments common;
  std::string map;
  std::vector<std::string> images;
  std::string camera;
  std::string depth;
  std::string poses;
  std::string trajectory;
  std::string output;
  bool adjusts = false;
  bool triangulates = false;
  std::optional<double> depth_units;
  LocateOptions options;
  static constexpr std::string_view kUnknown = "unknown";
  static constexpr std::string_view kShared = "shared";

  void add_to(const Command& command) {
    command
        .add_text("map", map,
                  "Map with ORB or SIFT descriptors: " + all_formats().titles_text() +
                      "; or an atlas, whose placed maps count as one")
        .required();
    command
        .add_words("images", images,
                   "Images to locate, JPEG or PNG, or folders of images; each image is located "
                   "separately, unless --poses is given",
                   "IMAGE")
        .required();
    command.add_text(
        "--camera", camera,
        fmt::format(
            "Camera of the images: {}; or unknown: the lens is found with the pose (EXIF data "
            "help); or "
            "shared: as unknown, but images of the same size and EXIF focal length have one lens "
            "(default: the map's camera for images of that size, or unknown if it has none or "
            "several)",
            kCameraHelp),
        "CAMERA");
    const Option measured = command.add_text(
        "--depth", depth,
        "Depth image (PNG, 16 bit) of the same view, for a single image; makes the pose more "
        "accurate",
        "FILE");
    add_number(command, "--depth-units", depth_units,
               "Depth image units per metre (default: from the camera file, else 5000)");
    add_options(command, LocateOptions::table, &options);
    command.add_text(
        "--trajectory", trajectory,
        "Write the poses of the located images, world_from_camera, in TUM format; timestamps "
        "are the images' names if all are numbers, else 0, 1, ...",
        "FILE");
    const Option together = command.add_text(
        "--poses", poses,
        "Locate all images as one. FILE has their poses relative to each other, as odometry gives "
        "them: a trajectory in metres, world_from_camera of any world, whose times are the images' "
        "names",
        "FILE");
    together.excludes(measured);
    const Option written = command.add_text(
        "-o,--output", output,
        fmt::format("Also write the map with the located images as further frames, each with "
                    "its matches as observations and descriptors: {}",
                    all_formats().endings_text()),
        "FILE");
    command
        .add_flag(
            "--triangulate", triangulates,
            "With --output: also add landmarks that two or more of the located images show and "
            "the map does not have")
        .needs(written);
    command.add_flag("--adjust", adjusts, "With --output: run a bundle adjustment of the whole map")
        .needs(written);
    common.add_to(command);
    common.add_threads_to(command);
    common.add_seed_to(command);
    command.list_under("Details", {"--depth-units", "--features", "--min-probability"});
    command.footer(
        "Example: find the pose of an image in a map\n"
        "  cairn locate desk.map image.png --camera fr1\n"
        "Example: where were these photographs taken, in a COLMAP model with database.db beside "
        "it?\n"
        "  cairn locate sparse/0 photo1.jpg photo2.jpg\n"
        "Example: add them to the model\n"
        "  cairn locate sparse/0 photo1.jpg photo2.jpg -o bigger/ --triangulate --adjust\n"
        "Example: locate a robot by several images, each of which shows too little\n"
        "  cairn locate lab.map 12.0.png 12.5.png 13.0.png --camera fr1 --poses odometry.tum\n"
        "The exit code is 0 if every image is located, 3 if a file is no image, else 4. A pose is "
        "right if\n"
        "it is within 5 degrees and 5 cm; in a map of free scale, within a sixtieth of the median "
        "distance of\n"
        "the landmarks from their centre instead of 5 cm.");
  }

  int run() {
    with_option_names({FeatureOptions::table, LocateOptions::table}, [&] { options.validate(); });
    images = listed_images(images);
    refuse_if(!depth.empty() && images.size() != 1, "--depth",
              fmt::format("given for {} images", images.size()), "one image");
    refuse_if(camera == kShared && !depth.empty(), "--depth", "given with --camera shared",
              "images without depth");
    require_outputs(common);
    require_one_stdout({{"--json", &common.json_path}, {"--trajectory", &trajectory}});
    if (!trajectory.empty() && trajectory != "-") require_folder_of(trajectory);
    if (!output.empty()) {
      require_map_path(output, "--output");
      std::set<std::string> seen;
      for (const std::string& image : images) {
        std::error_code ignored;
        const fs::path file = fs::weakly_canonical(image, ignored);
        refuse_if(!seen.insert(file.empty() ? image : file.string()).second, image,
                  "is given twice", "each image once");
      }
    }
    const LoadedMap loaded = load_world();
    std::optional<CameraFile> file;
    if (!camera.empty() && !finds_lens()) {
      file = load_camera(camera, {std::string(kUnknown), std::string(kShared)});
    }
    const auto stated_units = file ? file->depth_units_per_metre : std::nullopt;
    const double units = depth_units.value_or(stated_units.value_or(kTumDepthUnits));
    refuse_if(!(units > 0.0), "--depth-units", fmt::format("{}", units), "a positive number");
    const DepthImage depth_m =
        depth.empty() ? DepthImage() : metric_depth(read_depth_image(depth), units);
    const LengthUnit unit = loaded.map.info().length_unit;
    reject_if(!loaded.map.landmarks().descriptors && loaded.map.has_observations(),
              loaded.path + ": descriptors", "none",
              "ORB of 32 bytes or SIFT of 128; cairn convert MAP OUTPUT --images FOLDER computes "
              "SIFT of the map's images");
    reject_if(!poses.empty() && unit != LengthUnit::kMetres, loaded.path, "no unit of length",
              "a map in metres, as --poses are");
    const std::vector<Located> found =
        locate_all(loaded.map, file ? std::optional(file->camera) : std::nullopt, depth_m);
    Json json = describe(loaded, found);
    json["results"] = Json::array();
    bool all = true;
    bool all_read = true;
    const Console console = common.console();
    const Located* const group = poses.empty() ? nullptr : best_of(found);
    if (group != nullptr) {
      console.print("all images together: {}: {}\n", decision_of(group->location),
                    group->location.reason);
      console.print(location_hints(group->location, loaded.map, std::nullopt, options));
    }
    for (std::size_t i = 0; i < images.size(); ++i) {
      const auto& [location, lens, stated, defect] = found[i];
      if (!defect.empty()) {
        all_read = false;
        Json result = json_of(images[i], location, loaded.map);
        result["verdict"] = "unreadable";
        result["probability"] = nullptr;
        result["reason"] = defect;
        json["results"].push_back(std::move(result));
        console.print("{}: unreadable: {}\n", fs::path(images[i]).filename().string(), defect);
        continue;
      }
      json["results"].push_back(json_of(images[i], location, loaded.map));
      if (stated) json["results"].back()["exif_focal_length"] = *stated;
      std::string said = fmt::format("{}: {}", decision_of(location), location.reason);
      if (group != nullptr && location.located == group->location.located) {
        said = fmt::format("{}, {} own matches", decision_of(location), location.matches.size());
      }
      console.print(text_of(images[i], said, location, stated, unit));
      if (group == nullptr) console.print(location_hints(location, loaded.map, lens, options));
      all = all && location.located;
    }
    write_document(json, common);
    if (!trajectory.empty()) write_trajectory(found);
    if (!output.empty()) write_bigger_map(loaded.map, found);
    if (!all_read) return ExitCode::kBadInput;
    return all ? ExitCode::kDone : ExitCode::kNoTrustworthyAlignment;
  }

 private:
  struct Located {
    ImageLocation location;
    FocalLength lens = FocalLength::kKnown;
    std::optional<double> stated;
    std::string defect;  // of a file that is no image; empty for an image
  };

  // Of images located together, the one whose verdict is that of all; null if no file is an image.
  static const Located* best_of(const std::vector<Located>& found) {
    const Located* best = nullptr;
    for (const Located& one : found) {
      if (!one.defect.empty()) continue;
      if (best == nullptr || (one.location.located && !best->location.located)) best = &one;
    }
    return best;
  }

  bool finds_lens() const { return camera == kUnknown || camera == kShared; }

  // The map; or the maps of an atlas that have poses, as one.
  LoadedMap load_world() const {
#ifdef CAIRN_HAS_ATLAS
    if (is_postgres_url(map) || is_atlas_file(map)) {
      const std::string shown = without_password(map);
      // Before it is open, because to close the file again releases SQLite's locks on it.
      LoadedMap loaded{shown, {}, describe_file(shown, common)};
      Atlas atlas = Atlas::open(map, {.read_only = true});
      const AtlasState state = atlas.state();
      loaded.map = merged_world(atlas, state, common.execution("merging"));
      return loaded;
    }
#endif
    return load_map(map, common);
  }

  std::vector<Located> locate_all(const LandmarkMap& in_map, const std::optional<Camera>& given,
                                  const DepthImage& depth_m) const {
    const std::string descriptors = map + ": descriptors";
    std::optional<Locators> locators;
    with_option_names({{"descriptors", descriptors}},
                      [&] { locators.emplace(in_map, given, !finds_lens(), options); });
    std::vector<Located> found(images.size());
    if (!poses.empty()) {
      locate_as_one(*locators, found);
      return found;
    }
    if (camera == kShared) {
      locate_with_one_lens(*locators, found);
      return found;
    }
    common.executor().for_blocks(images.size(), 1, [&](std::size_t i, std::size_t) {
      found[i].defect = defect_of([&] { found[i] = located(images[i], *locators, depth_m); });
    });
    return found;
  }

  // Why a file is no image; empty if it is one. One file costs no other image its answer.
  std::string defect_of(const std::function<void()>& read) const {
    try {
      read();
    } catch (const Error& error) {
      if (error.kind() == ErrorKind::kCancelled || images.size() == 1) throw;
      return error.what();
    }
    return "";
  }

  // Images of one size, and with one focal length in their EXIF data, are by one camera.
  void locate_with_one_lens(Locators& locators, std::vector<Located>& found) const {
    std::map<const Locators::OfCamera*, std::vector<std::size_t>> images_of;
    std::mutex mutex;
    common.executor().for_blocks(images.size(), 1, [&](std::size_t i, std::size_t) {
      found[i].defect = defect_of([&] {
        const std::string bytes = read_file(images[i]);
        const auto image = decode_image<GrayImage>(bytes, images[i]);
        const Locators::OfCamera& own = locators.of_unknown(image, bytes);
        found[i].lens = own.lens;
        found[i].stated = own.stated;
        const std::lock_guard lock(mutex);
        images_of[&own].push_back(i);
      });
    });
    for (auto& [own, group] : images_of) {
      std::ranges::sort(group);
      const auto locations = locate_with_shared_lens(
          own->locator, group.size(),
          [&](std::size_t k) {
            return decode_image<GrayImage>(read_file(images[group[k]]), images[group[k]]);
          },
          common.execution("locating"));
      for (std::size_t k = 0; k < group.size(); ++k) found[group[k]].location = locations[k];
    }
  }

  void locate_as_one(Locators& locators, std::vector<Located>& found) const {
    const std::vector<Rigid3> odometry_from_camera = given_poses();
    std::vector<GrayImage> pixels(images.size());
    std::vector<BodyView> views;
    std::vector<Located*> seen;
    std::vector<OptionNames> names;
    for (std::size_t i = 0; i < images.size(); ++i) {
      std::string bytes;
      found[i].defect = defect_of([&] {
        bytes = read_file(images[i]);
        pixels[i] = decode_image<GrayImage>(bytes, images[i]);
      });
      if (!found[i].defect.empty()) continue;
      const Locators::OfCamera& own = locators.of(pixels[i], images[i], bytes);
      reject_if(own.lens == FocalLength::kUnknown, images[i], "an unknown camera",
                "--camera, or a map with one camera for images of this size: with --poses, images "
                "need a known lens");
      names.emplace_back(fmt::format("views[{}].image", views.size()), images[i]);
      views.push_back({&own.locator, &pixels[i], odometry_from_camera[i]});
      seen.push_back(&found[i]);
    }
    if (views.empty()) return;
    with_option_names(names, [&] {
      const auto locations = locate_together(views, common.execution("locating"));
      for (std::size_t k = 0; k < seen.size(); ++k) seen[k]->location = locations[k];
    });
  }

  // The images' poses in the world of the odometry.
  std::vector<Rigid3> given_poses() const {
    constexpr double kSameTime = 0.02;  // as associate()
    const Trajectory odometry = read_trajectory(poses, common.console().log());
    std::vector<Rigid3> result;
    for (const std::string& image : images) {
      const std::string stamp = fs::path(image).stem().string();
      const auto time = parse_number(stamp);
      refuse_if(!time, image, printable(stamp) + " is no number",
                "the time of a pose, because --poses are found by the images' names");
      const TimedPose* const nearest = nearest_pose(odometry, *time);
      reject_if(nearest == nullptr, poses, "no pose", "one for each image");
      std::optional<Rigid3> pose = interpolated(odometry, *time);
      if (!pose && std::abs(nearest->timestamp_s - *time) <= kSameTime) {
        pose = nearest->world_from_camera;
      }
      reject_if(
          !pose, poses,
          fmt::format("no pose of {} at {} s: the nearest is at {} s", image, stamp,
                      nearest->timestamp_s),
          fmt::format("one within {} s, or two that are at most 0.1 s apart around it", kSameTime));
      result.push_back(*pose);
    }
    return result;
  }

  Located located(const std::string& path, Locators& locators, const DepthImage& depth_m) const {
    const std::string bytes = read_file(path);
    const auto image = decode_image<GrayImage>(bytes, path);
    const Execution execution{.seed = common.seed};
    Located found;
    with_option_names({{"image", path}, {"depth image", depth}}, [&] {
      const auto locate = [&](const Locators::OfCamera& own) {
        found = {own.locator.locate(image, depth_m, execution), own.lens, own.stated, {}};
      };
      locate(locators.of(image, path, bytes));
      // Of the map's size, but by another camera.
      const bool by_another = camera.empty() && found.location.failure == LocationFailure::kLens;
      if (by_another) locate(locators.of_unknown(image, bytes));
    });
    return found;
  }

  Json describe(const LoadedMap& loaded, const std::vector<Located>& found) const {
    Json inputs = {{"map", loaded.description}, {"images", Json::array()}};
    if (!poses.empty()) inputs["poses"] = describe_file(poses, common);
    for (std::size_t i = 0; i < images.size(); ++i) {
      inputs["images"].push_back(found[i].defect.empty()
                                     ? describe_file(images[i], common)
                                     : Json{{"path", images[i]}, {"hash", nullptr}});
    }
    Json json = {{"camera", text_or_null(camera)},
                 {"depth", text_or_null(depth)},
                 {"poses", text_or_null(poses)},
                 {"adjust", adjusts},
                 {"triangulate", triangulates}};
    json.update(options_of(LocateOptions::table, &options));
    return document("locate", common, std::move(inputs), std::move(json));
  }

  void write_bigger_map(const LandmarkMap& in_map, const std::vector<Located>& found) const {
    std::vector<std::string> files;
    std::vector<LocatedImage> located;
    for (std::size_t i = 0; i < found.size(); ++i) {
      if (!found[i].location.located) continue;
      files.push_back(images[i]);
      located.push_back({"", found[i].location});
    }
    if (located.empty()) {
      common.console().print("no image is located, so {} is not written\n", output);
      return;
    }
    const std::vector<std::string> names = image_names(files, in_map);
    for (std::size_t i = 0; i < located.size(); ++i) {
      located[i].name = names[i];
      if (names[i].find('/') == std::string::npos) continue;
      common.console().remark("{} is called {}, because another image has its name", files[i],
                              names[i]);
    }
    LandmarkMap bigger = with_frames(in_map, located);
    if (triangulates) bigger = with_landmarks_of(files, bigger);
    if (adjusts) {
      AdjustOptions how;
      how.covariances = bigger.has_covariances();
      AdjustResult adjusted = adjust(bigger, how, common.execution("adjusting"));
      common.console().print("adjusted: reprojection error {:.3g} px, before {:.3g} px\n",
                             adjusted.final_rms_px, adjusted.initial_rms_px);
      bigger = std::move(adjusted.map);
    }
    save_map(bigger, output, common);
    common.console().print("{}: {} frames, {} of them new\n", output, bigger.frame_count(),
                           located.size());
  }

  // @param files those of the map's last frames
  LandmarkMap with_landmarks_of(const std::vector<std::string>& files,
                                const LandmarkMap& in_map) const {
    std::vector<FrameIndex> frames;
    const std::size_t first = in_map.frame_count() - files.size();
    for (std::size_t i = 0; i < files.size(); ++i) {
      frames.push_back(FrameIndex{static_cast<std::uint32_t>(first + i)});
    }
    const auto image_of = [&](FrameIndex frame) {
      return read_color_image(files[frame.value - first]);
    };
    LandmarkMap bigger = with_new_landmarks(in_map, frames, image_of, options.features,
                                            common.execution("finding landmarks"));
    common.console().print("{} new landmarks, seen by two or more of the {} located images\n",
                           bigger.landmark_count() - in_map.landmark_count(), files.size());
    return bigger;
  }

  void write_trajectory(const std::vector<Located>& found) const {
    const std::vector<std::string> stamps = stamps_of(images);
    std::string text = "# timestamp tx ty tz qx qy qz qw\n";
    for (std::size_t i = 0; i < found.size(); ++i) {
      const std::optional<Rigid3>& pose = found[i].location.world_from_camera;
      if (!pose) continue;
      const Eigen::Vector3d& at = pose->translation();
      const Eigen::Quaterniond turn = pose->quaternion();
      text += fmt::format("{} {} {} {} {} {} {} {}\n", stamps[i], at.x(), at.y(), at.z(), turn.x(),
                          turn.y(), turn.z(), turn.w());
    }
    write_text(text, trajectory);
  }
};

}  // namespace

void add_locate(const Command& program) {
  add_verb<LocateArguments>(program, "locate", "Find the pose of an image in a map, and judge it");
}

}  // namespace cairn::cli
