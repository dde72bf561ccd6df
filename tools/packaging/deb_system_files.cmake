# Read by cpack when the files of a package lie in its staging folder. The .deb alone puts files where the system looks for
# them; the bundle itself stays in one folder.
if(NOT CPACK_GENERATOR STREQUAL "DEB")
  return()
endif()
set(root ${CPACK_TEMPORARY_INSTALL_DIRECTORY})
set(bundle ${CPACK_PACKAGING_INSTALL_PREFIX})
if(NOT EXISTS ${root}${bundle}/bin)
  message(FATAL_ERROR "${root}${bundle} is not the staged bundle")
endif()

# Links: one copy of everything. A program finds its libraries from where it truly lies.
file(MAKE_DIRECTORY ${root}/usr/bin ${root}/usr/include ${root}/usr/share/doc/haustra)
foreach(program haustra haustrad)
  if(EXISTS ${root}${bundle}/bin/${program})
    file(CREATE_LINK ${bundle}/bin/${program} ${root}/usr/bin/${program} SYMBOLIC)
  endif()
endforeach()
file(CREATE_LINK ${bundle}/include/haustra_pose_ring.h ${root}/usr/include/haustra_pose_ring.h SYMBOLIC)
file(CREATE_LINK ${bundle}/licences ${root}/usr/share/doc/haustra/licences SYMBOLIC)
file(CREATE_LINK ${bundle}/licences/LICENSE ${root}/usr/share/doc/haustra/copyright SYMBOLIC)
file(CREATE_LINK ${bundle}/examples ${root}/usr/share/doc/haustra/examples SYMBOLIC)

set(service ${root}${bundle}/config/service)
file(COPY ${service}/haustrad.service DESTINATION ${root}/usr/lib/systemd/system)
file(MAKE_DIRECTORY ${root}/usr/lib/sysusers.d)
file(COPY_FILE ${service}/haustra.sysusers ${root}/usr/lib/sysusers.d/haustra.conf)
file(COPY ${service}/haustra.yaml DESTINATION ${root}/etc/haustra)
