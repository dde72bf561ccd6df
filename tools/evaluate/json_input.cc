#include "tools/evaluate/json_input.h"

#include "capture/files/whole_file.h"

namespace haustra::evaluate {

Result<nlohmann::json> ReadJsonObject(const std::string& path) {
  HAUSTRA_ASSIGN(const std::string text, ReadWholeText(path));
  nlohmann::json json;
  try {
    json = nlohmann::json::parse(text);
  } catch (const nlohmann::json::exception& error) {
    return InvalidArgument(path + ": " + error.what());
  }
  if (!json.is_object()) return InvalidArgument(path + ": not a JSON object");
  return json;
}

}  // namespace haustra::evaluate
