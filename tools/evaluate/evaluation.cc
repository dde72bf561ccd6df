#include "tools/evaluate/evaluation.h"

namespace haustra::evaluate {

std::string_view ToString(JoinKind kind) {
  switch (kind) {
    case JoinKind::kMerge: return "merge";
    case JoinKind::kLoop: return "loop";
    case JoinKind::kRelocalisation: return "relocalisation";
    case JoinKind::kRecovery: return "recovery";
  }
  return "unknown";
}

std::string_view ToString(Verdict verdict) {
  switch (verdict) {
    case Verdict::kTrue: return "true";
    case Verdict::kFalse: return "false";
    case Verdict::kUnjudged: return "unjudged";
  }
  return "unknown";
}

}  // namespace haustra::evaluate
