# Read by cpack once for each kind of package. Paths inside the .deb are those of an installed system.
if(CPACK_GENERATOR STREQUAL "DEB")
  set(CPACK_PACKAGING_INSTALL_PREFIX /opt/haustra)
endif()
