/* Streams the states of a flight through a model and prints the predicted accelerations and their parts as CSV.
 *
 *     stream run/network.safetensors flight.csv          a trained hybrid, physics and network
 *     stream model.toml flight.csv                       physics alone
 *
 * The flight is in the canonical form: a header, then t, the 16 states and controls, and further columns, which are not read.
 *
 *     cc -std=c99 stream.c -Iinclude target/release/libphyture_c.a -lm -lpthread -ldl -o stream
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "phyture.h"

enum { LINE = 4096, ROW = 1 + PHYTURE_STATES };

/* Reads t and the states of the next row. Returns 1, 0 at the end, -1 for a row that is too short. */
static int next_row(FILE *flight, double row[ROW])
{
    char line[LINE];
    const char *from = line;
    int column;
    if (fgets(line, sizeof line, flight) == NULL) {
        return 0;
    }
    for (column = 0; column < ROW; column++) {
        char *end;
        row[column] = strtod(from, &end);
        if (end == from) {
            return -1;
        }
        from = *end == ',' ? end + 1 : end;
    }
    return 1;
}

static void print_numbers(const double *numbers)
{
    int channel;
    for (channel = 0; channel < PHYTURE_ACCELERATIONS; channel++) {
        printf(",%.17g", numbers[channel]);
    }
}

/* Pushes row after row. Returns 0, or 1 and says on standard error what is wrong. */
static int stream_flight(PhytureStream *stream, FILE *flight)
{
    double row[ROW];
    PhyturePrediction predicted;
    int read;
    while ((read = next_row(flight, row)) == 1) {
        if (phyture_stream_push(stream, row + 1, PHYTURE_STATES, NULL, 0, &predicted) != PHYTURE_STATUS_OK) {
            fprintf(stderr, "at %g s: %s\n", row[0], phyture_stream_message(stream));
            return 1;
        }
        /* Physics is there at once, the rest when the network has its history. */
        if (predicted.complete) {
            printf("%.17g", row[0]);
            print_numbers(predicted.acceleration);
            print_numbers(predicted.physics);
            print_numbers(predicted.linear);
            print_numbers(predicted.network);
            printf("\n");
        }
    }
    if (read < 0) {
        fprintf(stderr, "a row has fewer than %d numbers\n", ROW);
        return 1;
    }
    return 0;
}

/* Reads the model by the ending of its name. NULL, and says what is wrong. */
static PhytureModel *read_model(const char *path)
{
    PhytureModel *model = NULL;
    char message[512];
    const char *ending = strrchr(path, '.');
    PhytureStatus status;
    if (ending != NULL && strcmp(ending, ".toml") == 0) {
        status = phyture_model_read(path, &model, message, sizeof message);
    } else {
        status = phyture_hybrid_read(path, &model, message, sizeof message);
    }
    if (status != PHYTURE_STATUS_OK) {
        fprintf(stderr, "%s\n", message);
    }
    return model;
}

/* The step of a flight from its first two rows, s; the flight then stands at its first row again. 0 if it has none. */
static double step_of(FILE *flight)
{
    char header[LINE];
    double first[ROW], second[ROW];
    long start;
    if (fgets(header, sizeof header, flight) == NULL || (start = ftell(flight)) < 0) {
        return 0.0;
    }
    if (next_row(flight, first) != 1 || next_row(flight, second) != 1 || fseek(flight, start, SEEK_SET) != 0) {
        return 0.0;
    }
    return second[0] - first[0];
}

static int run(const PhytureModel *model, FILE *flight)
{
    PhytureStream *stream = NULL;
    char message[512];
    int failed;
    if (phyture_stream_new(model, step_of(flight), &stream, message, sizeof message) != PHYTURE_STATUS_OK) {
        fprintf(stderr, "%s\n", message);
        return 1;
    }
    if (phyture_stream_own_count(stream) > 0) {
        fprintf(stderr, "the model reads `%s`, which this example does not give it\n", phyture_stream_own_name(stream, 0));
        failed = 1;
    } else {
        failed = stream_flight(stream, flight);
    }
    phyture_stream_free(stream);
    return failed;
}

int main(int count, char **words)
{
    PhytureModel *model;
    FILE *flight;
    int failed;
    if (count != 3) {
        fprintf(stderr, "stream MODEL FLIGHT.csv (phyture %s)\n", phyture_version());
        return 2;
    }
    model = read_model(words[1]);
    if (model == NULL) {
        return 2;
    }
    flight = fopen(words[2], "r");
    if (flight == NULL) {
        perror(words[2]);
        phyture_model_free(model);
        return 2;
    }
    failed = run(model, flight);
    fclose(flight);
    phyture_model_free(model);
    return failed;
}
