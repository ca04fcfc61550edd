// SPDX-License-Identifier: BSD-3-Clause
#include "support/change_documents.hpp"

#include <fmt/format.h>

#include "cairn/alignment/alignment.hpp"

#include "support/console.hpp"

namespace cairn::cli {
namespace {

Json numbers(const Eigen::Vector3d& v) {
  return {v.x(), v.y(), v.z()};
}

Json place_json(const std::optional<ChangedPlace>& place) {
  if (!place) return nullptr;
  return {{"position", numbers(place->centre)},
          {"low", numbers(place->low)},
          {"high", numbers(place->high)},
          {"size", numbers(place->high - place->low)},
          {"landmarks", place->landmarks.size()}};
}

std::string place_text(const ChangedPlace& place, const std::string& unit) {
  const Eigen::Vector3d size = place.high - place.low;
  return fmt::format("{} {} {}, {} x {} x {} {}, {} landmarks", fixed(place.centre.x(), 2),
                     fixed(place.centre.y(), 2), fixed(place.centre.z(), 2), fixed(size.x(), 2),
                     fixed(size.y(), 2), fixed(size.z(), 2), unit, place.landmarks.size());
}

}  // namespace

Json to_json(const ChangeResult& result) {
  Json json = {{"comparable_first", result.comparable_first},
               {"comparable_second", result.comparable_second},
               {"found_again", result.repeated},
               {"changes", Json::array()}};
  for (const Change& change : result.changes) {
    json["changes"].push_back(
        {{"kind", to_string(change.kind)},
         {"confidence", change.confidence},
         {"before", place_json(change.before)},
         {"after", place_json(change.after)},
         {"after_from_before", change.after_from_before
                                   ? to_json(Similarity3(*change.after_from_before).matrix())
                                   : Json(nullptr)}});
  }
  return json;
}

std::string changes_text(const ChangeResult& result, LengthUnit unit) {
  const std::string symbol = unit_symbol(unit);
  std::string text;
  for (const Change& change : result.changes) {
    text +=
        fmt::format("{:<8} {:>7}  ", to_string(change.kind), probability_text(change.confidence));
    if (change.before) text += "at " + place_text(*change.before, symbol);
    if (change.before && change.after) text += "; now ";
    if (change.after) text += "at " + place_text(*change.after, symbol);
    text += "\n";
  }
  return text;
}

}  // namespace cairn::cli
