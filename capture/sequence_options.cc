#include "capture/sequence_options.h"

namespace haustra {

Status SequenceOptions::Validate() const {
  if (every_nth == 0) return InvalidArgument("every_nth is 0; 1 reads every frame");
  if (last_frame < first_frame) {
    return InvalidArgument("the last frame, " + std::to_string(last_frame) + ", lies before the first, " +
                           std::to_string(first_frame));
  }
  return Status::Ok();
}

}  // namespace haustra
