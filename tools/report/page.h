// The page of a run: one HTML file with everything in it. reentrant, deterministic.
#pragma once

#include <map>
#include <string>
#include <string_view>

#include "tools/evaluate/evaluation.h"
#include "tools/evaluate/reference.h"
#include "tools/evaluate/run_output.h"
#include "tools/report/map_model.h"

namespace haustra::report {

struct PageContent {
  const evaluate::RunOutput& run;
  const evaluate::Reference& reference;  // without poses: nothing to compare with
  const evaluate::Evaluation& evaluation;
  const std::map<int, MapModel>& models;
  std::string pictures_html;   // of join_pictures.h; empty: no sequence was given
  std::string wall_html = {};  // of wall_pictures.h; empty: no surface was given, the page has no such section
  std::map<int, std::string> meshes = {};  // of surface_meshes.h, shown in place of the points while they are small
  std::string surface_json = "[]";         // ReadMapsOfSurface of the same, for the lumen of each mesh
};

// The beginning of every page, and of nothing else that is written.
std::string_view RunPageStart();

// The figures in it are those of ToJson(evaluation), which is in the page as well (script element "evaluation").
std::string MakePage(const PageContent& content);

}  // namespace haustra::report
