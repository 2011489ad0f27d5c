// Streams a made-up hover with a step of the collective through a model, and prints what it predicts along body down.
//
//     stream run/network.safetensors          a trained hybrid, physics and network
//     stream model.toml                       physics alone, 100 samples a second
//
//     c++ -std=c++11 stream.cpp -Iinclude -Ltarget/release -lphyture_c -o stream
#include <array>
#include <cstdio>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "phyture.h"

namespace {

// The handles free themselves.
struct Free {
    void operator()(PhytureModel *model) const { phyture_model_free(model); }
    void operator()(PhytureStream *stream) const { phyture_stream_free(stream); }
};
using Model = std::unique_ptr<PhytureModel, Free>;

using State = std::array<double, PHYTURE_STATES>;

constexpr double STEP_S = 0.01;

bool ends_with(const std::string &text, const std::string &end)
{
    return text.size() >= end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}

Model read_model(const std::string &path)
{
    PhytureModel *model = nullptr;
    std::array<char, 512> message{};
    const auto read = ends_with(path, ".toml") ? phyture_model_read : phyture_hybrid_read;
    if (read(path.c_str(), &model, message.data(), message.size()) != PHYTURE_STATUS_OK) {
        throw std::runtime_error(message.data());
    }
    return Model(model);
}

class Stream {
public:
    explicit Stream(const PhytureModel *model)
    {
        PhytureStream *stream = nullptr;
        std::array<char, 512> message{};
        const double trained_s = phyture_model_step_s(model);
        const double step_s = trained_s > 0.0 ? trained_s : STEP_S;
        if (phyture_stream_new(model, step_s, &stream, message.data(), message.size()) != PHYTURE_STATUS_OK) {
            throw std::runtime_error(message.data());
        }
        stream_.reset(stream);
        own_.resize(phyture_stream_own_count(stream), 0.0);
    }

    PhyturePrediction push(const State &state)
    {
        PhyturePrediction predicted;
        if (phyture_stream_push(stream_.get(), state.data(), state.size(), own_.data(), own_.size(), &predicted) != PHYTURE_STATUS_OK) {
            throw std::runtime_error(phyture_stream_message(stream_.get()));
        }
        return predicted;
    }

    std::size_t history() const { return phyture_stream_history(stream_.get()); }

private:
    std::unique_ptr<PhytureStream, Free> stream_;
    // Columns of the log's own, all at rest here.
    std::vector<double> own_;
};

} // namespace

int main(int count, char **words)
{
    if (count != 2) {
        std::fprintf(stderr, "stream MODEL (phyture %s)\n", phyture_version());
        return 2;
    }
    try {
        // The stream keeps what it needs of the model, which goes at the end of this line.
        Stream stream(read_model(words[1]).get());
        State state{};
        state[PHYTURE_STATE_Z] = -10.0;
        const std::size_t samples = stream.history() + 100;
        for (std::size_t sample = 0; sample < samples; sample++) {
            state[PHYTURE_STATE_U4] = sample < samples / 2 ? 0.0 : 0.1;
            const PhyturePrediction predicted = stream.push(state);
            if (predicted.complete) {
                std::printf("%zu %.17g %.17g\n", sample, predicted.acceleration[PHYTURE_ACCELERATION_VZ_DOT],
                            predicted.physics[PHYTURE_ACCELERATION_VZ_DOT]);
            }
        }
    } catch (const std::exception &error) {
        std::fprintf(stderr, "%s\n", error.what());
        return 1;
    }
    return 0;
}
