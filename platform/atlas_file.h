// Atlas files on the disk. A file is replaced as a whole or not at all (file_sink.h), so that a crash, a power cut or a
// full disk leaves the one before it. Messages name the file.
#pragma once

#include <string>

#include "engine/engine.h"

namespace haustra {

// When the mapping thread has stopped, or on it. kNotFound: no such folder; kUnavailable: cannot be written.
Status SaveAtlasFile(const Engine& engine, const std::string& path);

// Whether SaveAtlasFile could begin there; leaves nothing behind.
Status CheckAtlasFileCanBeSaved(const std::string& path);

// Whether it is there, and whole. What only an engine can say of it comes with LoadAtlasFile. Errors as there.
Status CheckAtlasFileCanBeLoaded(const std::string& path);

// Before the first frame; see Engine::LoadAtlas. kNotFound: no such file; kUnavailable: cannot be read.
Status LoadAtlasFile(const std::string& path, Engine* engine);

}  // namespace haustra
