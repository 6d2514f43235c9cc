/* A firmware for the example in docs/virtual-motor.md: it turns a voltage vector, and counts what it reads. */
#include "stm32g4xx_hal.h"

ADC_HandleTypeDef hadc1;
TIM_HandleTypeDef htim1, htim2;
static const uint32_t sine[6] = {2125, 2309, 2309, 2125, 1941, 1941};
static uint32_t interrupts;

void HAL_ADCEx_InjectedConvCpltCallback(ADC_HandleTypeDef *adc) {
    uint32_t at = interrupts++ / 400;
    if (HAL_ADCEx_InjectedGetValue(adc, ADC_INJECTED_RANK_1) > 4095 || htim2.Instance->CNT > 4095) return;
    __HAL_TIM_SET_COMPARE(&htim1, 1, sine[(at + 2) % 6]);
    __HAL_TIM_SET_COMPARE(&htim1, 2, sine[at % 6]);
    __HAL_TIM_SET_COMPARE(&htim1, 3, sine[(at + 4) % 6]);
}
