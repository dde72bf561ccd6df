#include "platform/atlas_file.h"

#include "capture/files/file_sink.h"
#include "capture/files/whole_file.h"
#include "engine/io/atlas_reader.h"

namespace haustra {
namespace {

Status WithPath(const std::string& path, const Status& status) {
  return status.ok() ? status : Status(status.code(), path + ": " + status.message());
}

}  // namespace

Status SaveAtlasFile(const Engine& engine, const std::string& path) {
  HAUSTRA_ASSIGN(FileSink sink, FileSink::Create(path));
  // The sink's own errors name the file; the engine's do not.
  if (const Status status = engine.SaveAtlas(sink); !status.ok()) {
    return status.message().starts_with(path) ? status : WithPath(path, status);
  }
  return sink.Commit();
}

Status CheckAtlasFileCanBeSaved(const std::string& path) { return FileSink::Create(path).status(); }

Status CheckAtlasFileCanBeLoaded(const std::string& path) {
  HAUSTRA_ASSIGN(const std::vector<std::uint8_t> bytes, ReadWholeFile(path));
  return WithPath(path, ReadAtlas(bytes).status());
}

Status LoadAtlasFile(const std::string& path, Engine* engine) {
  HAUSTRA_ASSIGN(const std::vector<std::uint8_t> bytes, ReadWholeFile(path));
  return WithPath(path, engine->LoadAtlas(bytes));
}

}  // namespace haustra
