#include "llvmpipe.hpp"

#define EGL_EGLEXT_PROTOTYPES
#define GL_GLEXT_PROTOTYPES
#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <GL/gl.h>
#include <GL/glext.h>

#include <cstdlib>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <vector>

namespace calipso::render {
namespace {

const char* const kVertexShader = R"(#version 330 core
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
uniform mat4 clip_from_world;
out vec3 p, n;
void main() { p = position; n = normal; gl_Position = clip_from_world * vec4(position, 1.0); })";

// Torrance-Sparrow with the distribution that ours has over a procedural albedo, sun and ambient
// light.
const char* const kFragmentShader = R"(#version 330 core
in vec3 p, n;
uniform vec3 eye, to_sun;
out vec4 colour;
void main() {
  vec3 N = normalize(n), V = normalize(eye - p);
  float nl = max(dot(N, to_sun), 0.0), nv = max(dot(N, V), 1e-3);
  vec3 H = normalize(to_sun + V);
  float c = max(dot(N, H), 1e-3), c2 = c * c, m2 = 0.09, vh = max(dot(V, H), 1e-3);
  float root = 1.0 - c2 * (1.0 - m2), D = m2 / (root * root);
  float G = min(1.0, min(2.0 * c * nv / vh, 2.0 * c * nl / vh));
  vec3 albedo = vec3(0.3) + 0.1 * sin(160.0 * p.x) * sin(140.0 * p.y);
  vec3 radiance = albedo * (vec3(0.3) + 0.65 * nl) + vec3(0.04 * 0.65 * D * G / (4.0 * nv));
  colour = vec4(pow(radiance, vec3(1.0 / 2.2)), 1.0);
})";

void demand(bool fulfilled, const std::string& what) {
  if (!fulfilled) throw std::runtime_error("OpenGL without a window: " + what);
}

GLuint compiled(GLenum kind, const char* source) {
  const GLuint shader = glCreateShader(kind);
  glShaderSource(shader, 1, &source, nullptr);
  glCompileShader(shader);
  GLint done = 0;
  glGetShaderiv(shader, GL_COMPILE_STATUS, &done);
  demand(done != 0, "a shader does not compile");
  return shader;
}

// Column-major, near 0.01 m, far 10 m; rows as in the camera's picture (the first one is the top).
Eigen::Matrix4f clipFromWorld(const Camera& c) {
  constexpr double kNear = 0.01, kFar = 10.0;
  Eigen::Matrix4d clip = Eigen::Matrix4d::Zero();
  clip(0, 0) = 2.0 * c.fx / c.width, clip(0, 2) = (2.0 * c.cx + 1.0) / c.width - 1.0;
  clip(1, 1) = 2.0 * c.fy / c.height, clip(1, 2) = (2.0 * c.cy + 1.0) / c.height - 1.0;
  clip(2, 2) = (kFar + kNear) / (kFar - kNear), clip(2, 3) = -2.0 * kFar * kNear / (kFar - kNear);
  clip(3, 2) = 1.0;
  return (clip * c.world_from_camera.inverse().matrix()).cast<float>();
}

}  // namespace

struct LlvmpipeDrawing::Context {
  EGLDisplay display = EGL_NO_DISPLAY;
  EGLContext context = EGL_NO_CONTEXT;
  GLuint vertices = 0, normals = 0, indices = 0;

  void open() {
    setenv("LIBGL_ALWAYS_SOFTWARE", "1", 1);
    display = eglGetPlatformDisplay(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, nullptr);
    demand(display != EGL_NO_DISPLAY && eglInitialize(display, nullptr, nullptr),
           "no EGL display; Mesa's EGL is needed");
    demand(eglBindAPI(EGL_OPENGL_API), "EGL offers no OpenGL");
    const EGLint version[] = {EGL_CONTEXT_MAJOR_VERSION, 3, EGL_CONTEXT_MINOR_VERSION, 3, EGL_NONE};
    context = eglCreateContext(display, EGL_NO_CONFIG_KHR, EGL_NO_CONTEXT, version);
    demand(context != EGL_NO_CONTEXT &&
               eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, context),
           "no context of version 3.3");
  }
};

LlvmpipeDrawing::LlvmpipeDrawing(const DrawingCase& drawing)
    : context_(new Context), drawing_(drawing) {
  Context& c = *context_;
  c.open();
  const Camera& camera = drawing.prepared->camera;
  GLuint frame, targets[2], array;
  glGenFramebuffers(1, &frame), glBindFramebuffer(GL_FRAMEBUFFER, frame);
  glGenRenderbuffers(2, targets);
  const GLenum formats[] = {GL_RGBA8, GL_DEPTH_COMPONENT24},
               places[] = {GL_COLOR_ATTACHMENT0, GL_DEPTH_ATTACHMENT};
  for (int i = 0; i < 2; ++i) {
    glBindRenderbuffer(GL_RENDERBUFFER, targets[i]);
    glRenderbufferStorage(GL_RENDERBUFFER, formats[i], camera.width, camera.height);
    glFramebufferRenderbuffer(GL_FRAMEBUFFER, places[i], GL_RENDERBUFFER, targets[i]);
  }
  demand(glCheckFramebufferStatus(GL_FRAMEBUFFER) == GL_FRAMEBUFFER_COMPLETE,
         "the picture's buffer is incomplete");
  glViewport(0, 0, camera.width, camera.height);
  glEnable(GL_DEPTH_TEST);
  glGenVertexArrays(1, &array), glBindVertexArray(array);
  const Surface& surface = drawing.prepared->surfaces.front();
  const std::size_t bytes = surface.key_vertices.size() * sizeof(Eigen::Vector3f);
  GLuint* const buffers[] = {&c.vertices, &c.normals};
  for (GLuint i = 0; i < 2; ++i) {
    glGenBuffers(1, buffers[i]), glBindBuffer(GL_ARRAY_BUFFER, *buffers[i]);
    glBufferData(GL_ARRAY_BUFFER, bytes, nullptr, GL_DYNAMIC_DRAW);
    glVertexAttribPointer(i, 3, GL_FLOAT, GL_FALSE, 0, nullptr), glEnableVertexAttribArray(i);
  }
  glGenBuffers(1, &c.indices), glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, c.indices);
  glBufferData(GL_ELEMENT_ARRAY_BUFFER, surface.triangles.size() * sizeof(Eigen::Vector3i),
               surface.triangles.data(), GL_STATIC_DRAW);
  const GLuint program = glCreateProgram();
  glAttachShader(program, compiled(GL_VERTEX_SHADER, kVertexShader)),
      glAttachShader(program, compiled(GL_FRAGMENT_SHADER, kFragmentShader));
  glLinkProgram(program), glUseProgram(program);
  const Eigen::Matrix4f clip = clipFromWorld(camera);
  const Eigen::Vector3f eye = camera.world_from_camera.translation().cast<float>(),
                        sun = drawing.prepared->light.light.direction;
  glUniformMatrix4fv(glGetUniformLocation(program, "clip_from_world"), 1, GL_FALSE, clip.data());
  glUniform3fv(glGetUniformLocation(program, "eye"), 1, eye.data());
  glUniform3fv(glGetUniformLocation(program, "to_sun"), 1, sun.data());
}

LlvmpipeDrawing::~LlvmpipeDrawing() {
  eglDestroyContext(context_->display, context_->context);
  eglTerminate(context_->display);
  delete context_;
}

cv::Mat LlvmpipeDrawing::draw(const Points& vertices) {
  const Surface& surface = drawing_.prepared->surfaces.front();
  const Points normals = vertexNormals(vertices, surface.triangles);
  const std::size_t bytes = vertices.size() * sizeof(Eigen::Vector3f);
  glBindBuffer(GL_ARRAY_BUFFER, context_->vertices),
      glBufferSubData(GL_ARRAY_BUFFER, 0, bytes, vertices.data());
  glBindBuffer(GL_ARRAY_BUFFER, context_->normals),
      glBufferSubData(GL_ARRAY_BUFFER, 0, bytes, normals.data());
  glClearColor(0, 0, 0, 1);
  glClear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
  glDrawElements(GL_TRIANGLES, static_cast<GLsizei>(3 * surface.triangles.size()), GL_UNSIGNED_INT,
                 nullptr);
  cv::Mat picture(drawing_.prepared->camera.height, drawing_.prepared->camera.width, CV_8UC4), bgr;
  glReadPixels(0, 0, picture.cols, picture.rows, GL_BGRA, GL_UNSIGNED_BYTE, picture.data);
  cv::cvtColor(picture, bgr, cv::COLOR_BGRA2BGR);
  return bgr;
}

std::string LlvmpipeDrawing::renderer() const {
  return reinterpret_cast<const char*>(glGetString(GL_RENDERER));
}

}  // namespace calipso::render
