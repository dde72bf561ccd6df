#include "tools/view/page_site.h"

#include <string>

#include "hal/core/check.h"
#include "tools/report/html_text.h"
#include "tools/report/page_assets.h"
#include "tools/view/view_assets.h"

namespace haustra::view {
namespace {

void Replace(std::string_view mark, std::string_view text, std::string* page) {
  const std::size_t at = page->find(mark);
  HAUSTRA_CHECK(at != std::string::npos);
  page->replace(at, mark.size(), text);
}

ViewResource Script(std::string_view text) { return {"text/javascript; charset=utf-8", std::string(text)}; }

}  // namespace

ViewSite MakePageSite(PageKind kind) {
  std::string page(ViewHtml());
  Replace("KIND.js", kind == PageKind::kRun ? "run.js" : "live.js", &page);
  Replace("MARKING", kind == PageKind::kLiveWithMarking ? "on" : "off", &page);
  Replace("<!-- LICENCES -->",
          "<pre id=\"licences\">" + report::EscapeHtml(report::ChartJsLicence()) +
              report::EscapeHtml(report::ThreeJsLicence()) + "</pre>",
          &page);
  ViewSite site;
  site.resources[""] = {"text/html; charset=utf-8", std::move(page)};
  site.resources["view.css"] = {"text/css; charset=utf-8", std::string(ViewCss())};
  site.resources["three.js"] = Script(report::ThreeJs());
  site.resources["chart.js"] = Script(report::ChartJs());
  site.resources["scene_3d.js"] = Script(report::Scene3dJs());
  site.resources["panels.js"] = Script(PanelsJs());
  if (kind == PageKind::kRun) {
    site.resources["run.js"] = Script(RunJs());
  } else {
    site.resources["live.js"] = Script(LiveJs());
  }
  return site;
}

}  // namespace haustra::view
