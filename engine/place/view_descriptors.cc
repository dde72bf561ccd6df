#include "engine/place/view_descriptors.h"

#include <string>

namespace haustra {

ViewDescriptors::ViewDescriptors(VisionDevice& device)
    : device_(device), descriptors_(static_cast<std::size_t>(device.plan().max_features) * kDescriptorBytes) {}

std::size_t ViewDescriptors::BytesFor(int max_features) {
  return static_cast<std::size_t>(max_features) * kDescriptorBytes;
}

Status ViewDescriptors::Read(FeatureSetHandle set, std::span<const std::int32_t> features) {
  for (const std::int32_t feature : features) {
    if (feature < 0 || feature >= device_.plan().max_features) {
      return InvalidArgument("retrieval: there is no feature " + std::to_string(feature));
    }
  }
  return device_.ReadDescriptors(set, descriptors_);
}

}  // namespace haustra
