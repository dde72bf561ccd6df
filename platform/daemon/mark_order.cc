#include "platform/daemon/mark_order.h"

#include <map>

#include "platform/control/control_protocol.h"

namespace haustra {

static_assert(kMaxMarkNameBytes == kMaxMarkLabelBytes);

Result<std::string> DoMarkOrder(const MarkOrder& order, Engine& engine) {
  const std::string label(order.request.label.view());
  switch (order.kind) {
    case MarkOrder::Kind::kSet: HAUSTRA_TRY(engine.SetMark(order.request).status()); return "marked " + label + "\n";
    case MarkOrder::Kind::kRemove: HAUSTRA_TRY(engine.RemoveMark(label)); return "removed " + label + "\n";
    case MarkOrder::Kind::kList: break;
  }
  const Atlas& atlas = engine.atlas();
  std::map<MarkId, std::string> lines;
  atlas.marks().ForEach([&](MarkHandle, const Mark& mark) {
    lines[mark.id] = std::string(mark.label.view()) + " session " + std::to_string(mark.session) + " frame " +
                     std::to_string(mark.frame_index) + " map " +
                     std::to_string(atlas.map(atlas.PlaceOf(mark).map).id) + "\n";
  });
  std::string text;
  for (const auto& [id, line] : lines) text += line;
  return text.empty() ? std::string("no marks\n") : text;
}

}  // namespace haustra
