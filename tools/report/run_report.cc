#include "tools/report/run_report.h"

#include <utility>

#include "tools/report/page.h"
#include "tools/report/wall_pictures.h"

namespace haustra::report {
Result<std::string> MakeRunReport(const ReportRequest& request) {
  evaluate::Reference reference;
  if (!request.groundtruth.empty()) {
    HAUSTRA_ASSIGN(reference, evaluate::ReadReference(request.groundtruth, request.events));
  }
  HAUSTRA_ASSIGN(const evaluate::RunOutput run, evaluate::ReadRunOutput(request.run));
  HAUSTRA_ASSIGN(const auto models, ReadMapModels(run));
  const evaluate::Evaluation evaluation = evaluate::EvaluateRun(run, reference, request.options);
  std::string pictures;
  if (!request.pictures.sequence.empty()) {
    HAUSTRA_ASSIGN(pictures, JoinPicturesHtml(run, evaluation, models, request.pictures));
  }
  std::string walls;
  if (!request.surface.empty()) {
    HAUSTRA_ASSIGN(walls, WallPicturesHtml(request.surface));
  }
  return MakePage({run, reference, evaluation, models, pictures, walls});
}

}  // namespace haustra::report
