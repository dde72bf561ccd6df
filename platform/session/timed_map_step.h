// One step of mapping, or of merging, with what it took; the stages of mapping from the difference of its counters.
#pragma once

#include "engine/engine.h"
#include "platform/session/session.h"

namespace haustra {

// As Engine::MapStep; `times` is filled when it returns true. thread-bound(mapping).
inline bool TimedMapStep(Engine& engine, const Clock& clock, MapWork work, MappingTimes* times) {
  *times = MappingTimes{};
  times->start = clock.Now();
  const MapperCounters before = engine.mapper_counters();
  if (!engine.MapStep(work)) return false;
  const MapperCounters& after = engine.mapper_counters();
  times->insert = after.insert_time - before.insert_time;
  times->create = after.create_time - before.create_time;
  times->fuse = after.fuse_time - before.fuse_time;
  times->bundle = after.bundle_time - before.bundle_time;
  times->cull = after.cull_time - before.cull_time;
  times->asking = after.asking_time - before.asking_time;
  times->place = after.place_time - before.place_time;
  times->merge = after.merge_time - before.merge_time;
  times->relocalisation = after.relocalisation_time - before.relocalisation_time;
  return true;
}

// As Engine::MergeStep. thread-bound(merging).
inline bool TimedMergeStep(Engine& engine, const Clock& clock, MappingTimes* times) {
  *times = MappingTimes{};
  times->start = clock.Now();
  if (!engine.MergeStep()) return false;
  times->recognition = clock.Now() - times->start;
  return true;
}

}  // namespace haustra
