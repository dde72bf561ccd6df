// What a page carries with it, built into the program (embed_assets.cmake). reentrant.
#pragma once

#include <string_view>

namespace haustra::report {

std::string_view ChartJs();         // Chart.js, minified
std::string_view ChartJsLicence();  // to be handed on with it
std::string_view ThreeJs();         // three.js, minified, with OrbitControls, wide lines and PLYLoader
std::string_view ThreeJsLicence();  // to be handed on with it
std::string_view Scene3dJs();       // a map in 3D, with pins
std::string_view ReportJs();        // draws the plots
std::string_view ReportCss();

}  // namespace haustra::report
